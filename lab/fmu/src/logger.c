/* fmi2CallbackLogger (FMI 2.0, section 2.1.5) has a variable number of arguments, which stable Rust cannot define. */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

extern void vines_fmi2_line(void *environment, int status, const char *category, const char *text);

void vines_fmi2_logger(void *environment, const char *instance, int status, const char *category, const char *message,
                       ...) {
    (void)instance;
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
    vines_fmi2_line(environment, status, category, text);
    free(text);
}
