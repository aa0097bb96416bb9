/* fmi2CallbackLogger (FMI 2.0, section 2.1.5) has a variable number of arguments, which stable Rust cannot define. */
#include <stdarg.h>
#include <stdio.h>

extern void vines_fmu_log(void *environment, int status, const char *message);

void vines_fmu_logger(void *environment, const char *instance, int status, const char *category, const char *message, ...) {
    (void)instance;
    (void)category;
    char text[1024];
    va_list arguments;
    va_start(arguments, message);
    int length = message ? vsnprintf(text, sizeof text, message, arguments) : 0;
    va_end(arguments);
    if (length > 0)
        vines_fmu_log(environment, status, text);
}
