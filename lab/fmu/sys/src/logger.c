/* fmi2CallbackLogger (FMI 2.0, section 2.1.5) has a variable number of arguments, which stable Rust cannot define. */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

extern void vines_fmi2_log(const char *instance, int status, const char *message);

void callback_logger_handler(void *environment, const char *instance, int status, const char *category,
                             const char *message, ...) {
    (void)environment;
    (void)category;
    va_list arguments;
    va_start(arguments, message);
    int length = message ? vsnprintf(NULL, 0, message, arguments) : 0;
    va_end(arguments);
    if (length <= 0)
        return;
    char *text = malloc((size_t)length + 1);
    if (!text)
        return;
    va_start(arguments, message);
    vsnprintf(text, (size_t)length + 1, message, arguments);
    va_end(arguments);
    vines_fmi2_log(instance, status, text);
    free(text);
}
