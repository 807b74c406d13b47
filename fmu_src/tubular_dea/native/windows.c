/* What a library for Windows has of its own, so that nothing is linked but the C library of the system: no start-up
 * code, as nothing needs one, and C99's formatting by the function that the system's library has for it. */
#include <stdarg.h>
#include <stddef.h>

#define AS_IN_C99 2ULL /* what is cut off ends with a zero, and the whole length is returned */

int __stdcall DllMainCRTStartup(void *module, unsigned long reason, void *reserved)
{
    (void)module, (void)reason, (void)reserved;
    return 1;
}

int _fltused = 0; /* the compiler's word that doubles are used */

int __cdecl __stdio_common_vsprintf(
    unsigned long long options, char *text, size_t size, const char *format, void *locale, va_list values);

int vsnprintf(char *text, size_t size, const char *format, va_list values)
{
    return __stdio_common_vsprintf(AS_IN_C99, text, size, format, NULL, values);
}

int snprintf(char *text, size_t size, const char *format, ...)
{
    va_list values;
    va_start(values, format);
    int length = vsnprintf(text, size, format, values);
    va_end(values);
    return length;
}
