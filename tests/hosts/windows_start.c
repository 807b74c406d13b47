/* How a program of Windows begins and writes with nothing but the C library of the system: zig would first compile a C
 * library of its own, which takes more than a minute. The formatting of strings is that of the FMUs (native/windows.c). */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

#define AS_IN_C99 1ULL /* of the options of reading and writing */
#define AS_THEY_ARE 1  /* of arguments: no wildcards in them */

int __cdecl _configure_narrow_argv(int mode);
int main(int argc, char **argv);

void __main(void) {} /* what the compiler has main call first: constructors, of which C has none */

void mainCRTStartup(void)
{
    _configure_narrow_argv(AS_THEY_ARE);
    exit(main(*__p___argc(), *__p___argv()));
}

int vfprintf(FILE *file, const char *format, va_list values)
{
    return __stdio_common_vfprintf(AS_IN_C99, file, format, NULL, values);
}

int fprintf(FILE *file, const char *format, ...)
{
    va_list values;
    va_start(values, format);
    const int length = vfprintf(file, format, values);
    va_end(values);
    return length;
}

int printf(const char *format, ...)
{
    va_list values;
    va_start(values, format);
    const int length = vfprintf(stdout, format, values);
    va_end(values);
    return length;
}

int scanf(const char *format, ...)
{
    va_list values;
    va_start(values, format);
    const int found = __stdio_common_vfscanf(AS_IN_C99, stdin, format, NULL, values);
    va_end(values);
    return found;
}
