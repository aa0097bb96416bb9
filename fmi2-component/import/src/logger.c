/* The logger that an FMU calls (FMI 2.0, clause 2.1.5): formats the message and passes it to Rust. */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

struct sink {
    void (*write)(const char *instance, int status, const char *text);
};

void fmi2_import_logger(void *environment, const char *instance, int status, const char *category,
                        const char *message, ...) {
    const struct sink *sink = environment;
    va_list arguments;
    (void)category;
    /* Some FMUs pass NULL. */
    if (!sink || !message) return;
    va_start(arguments, message);
    int length = vsnprintf(NULL, 0, message, arguments);
    va_end(arguments);
    char *text = length < 0 ? NULL : malloc((size_t)length + 1);
    if (!text) return;
    va_start(arguments, message);
    vsnprintf(text, (size_t)length + 1, message, arguments);
    va_end(arguments);
    sink->write(instance, status, text);
    free(text);
}
