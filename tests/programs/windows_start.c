/* Starts a program for Windows with the C functions of Windows alone. */

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

int main(int argc, char **argv);
int _configure_narrow_argv(int mode);

void __main(void) {} /* is called where main begins, for constructors */

int printf(const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    const int length = __stdio_common_vfprintf(0, stdout, format, NULL, arguments);
    va_end(arguments);
    return length;
}

void mainCRTStartup(void) {
    _configure_narrow_argv(1);
    exit(main(*__p___argc(), *__p___argv()));
}
