/* What a page needs beside the functions of FMI 2.0: an instance whose messages go to the page, and their text. */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

#include "fmi2Functions.h"

__attribute__((import_module("page"), import_name("say"))) void page_say(int status, const char *message);
/* Writes a number with so many significant digits, and a 0 after them. */
__attribute__((import_module("page"), import_name("number"))) void page_number(double value, int digits, char *text);

/* In place of the C library's, whose names page.py gives to these: with its long doubles that one is a sixth of a
   module.  Takes what our messages have: %s %c %d %u %lu %zu %g %.9g %.0e %%; %e is written as %g. */
int page_vsnprintf(char *text, size_t size, const char *format, va_list values) {
    size_t length = 0;
    for (; *format != '\0'; format++) {
        char word[32] = {*format, '\0'};
        const char *said = word;
        if (*format == '%') {
            int digits = 6;
            if (*++format == '.')
                for (digits = 0, format++; *format >= '0' && *format <= '9'; format++) digits = 10 * digits + (*format - '0');
            while (*format == 'l' || *format == 'z') format++; /* as long as an int */
            switch (*format) {
                case 's': said = va_arg(values, const char *); break;
                case 'c': word[0] = (char)va_arg(values, int); break;
                case 'd': page_number(va_arg(values, int), 10, word); break;
                case 'u': page_number(va_arg(values, unsigned), 10, word); break;
                case 'e':
                case 'g': page_number(va_arg(values, double), digits > 0 ? digits : 1, word); break;
                default: word[0] = *format;
            }
        }
        for (; *said != '\0'; said++, length++)
            if (length + 1 < size) text[length] = *said;
    }
    if (size > 0) text[length < size ? length : size - 1] = '\0';
    return (int)length;
}

int page_snprintf(char *text, size_t size, const char *format, ...) {
    va_list values;
    va_start(values, format);
    const int length = page_vsnprintf(text, size, format, values);
    va_end(values);
    return length;
}

static void say(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                fmi2String format, ...) {
    char message[1024];
    va_list values;
    (void)environment, (void)name, (void)category;
    va_start(values, format);
    page_vsnprintf(message, sizeof message, format, values);
    va_end(values);
    page_say(status, message);
}

static const fmi2CallbackFunctions callbacks = {say, calloc, free, NULL, NULL};

__attribute__((export_name("page_instantiate"))) fmi2Component page_instantiate(const char *guid) {
    return fmi2Instantiate("page", fmi2CoSimulation, guid, "", &callbacks, fmi2True, fmi2True);
}
