/* What a shared library for Windows needs beside the C functions that are a part of Windows, the Universal C
 * Runtime: its beginning and its end, and functions that headers and compilers leave to a library. */

#include <stdarg.h>
#include <stddef.h>

typedef void Function(void);

extern Function *__CTOR_LIST__[]; /* of the linker: constructors, between two other words */
static Function *at_exit[32];
static int registered;

int atexit(Function *function) {
    if (registered == sizeof at_exit / sizeof *at_exit) return 1;
    at_exit[registered++] = function;
    return 0;
}

/* Called by Windows where the library is loaded (1), where it is unloaded or the process ends (0). */
int DllMainCRTStartup(void *library, unsigned reason, void *reserved) {
    (void)library, (void)reserved;
    int n = 1;
    if (reason == 1) {
        while (__CTOR_LIST__[n]) n++;
        while (--n) __CTOR_LIST__[n]();
    }
    if (reason == 0)
        while (registered) at_exit[--registered]();
    return 1;
}

int __stdio_common_vsprintf(unsigned long long options, char *text, size_t size, const char *format,
                            void *locale, va_list arguments);

int vsnprintf(char *text, size_t size, const char *format, va_list arguments) {
    enum { AS_IN_C99 = 2 };
    return __stdio_common_vsprintf(AS_IN_C99, text, size, format, NULL, arguments);
}

int snprintf(char *text, size_t size, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    const int length = vsnprintf(text, size, format, arguments);
    va_end(arguments);
    return length;
}

int __isnan(double x) { return x != x; }

/* The numbers are those of FP_NAN, FP_INFINITE, FP_NORMAL, FP_SUBNORMAL and FP_ZERO in <math.h>. */
int __fpclassify(double x) { return __builtin_fpclassify(0x100, 0x500, 0x400, 0x4400, 0x4000, x); }

/* Called where a function begins whose variables take rax bytes, more than a page: touches each page, since
 * Windows makes the stack longer a page at a time. It changes no register. */
__asm__(".globl ___chkstk_ms\n"
        "___chkstk_ms:\n"
        "    push %rcx\n"
        "    push %rax\n"
        "    lea 24(%rsp), %rcx\n" /* the caller's stack */
        "1:  cmp $0x1000, %rax\n"
        "    jb 2f\n"
        "    sub $0x1000, %rcx\n"
        "    orl $0, (%rcx)\n"
        "    sub $0x1000, %rax\n"
        "    jmp 1b\n"
        "2:  sub %rax, %rcx\n"
        "    orl $0, (%rcx)\n"
        "    pop %rax\n"
        "    pop %rcx\n"
        "    ret\n");
