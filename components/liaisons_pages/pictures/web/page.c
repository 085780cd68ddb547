/* What a page needs beside the functions of FMI 2.0: an instance whose messages go to the page. */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

#include "fmi2Functions.h"

__attribute__((import_module("page"), import_name("say"))) void page_say(int status, const char *message);

static void say(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                fmi2String format, ...) {
    char message[1024];
    va_list values;
    (void)environment, (void)name, (void)category;
    va_start(values, format);
    vsnprintf(message, sizeof message, format, values);
    va_end(values);
    page_say(status, message);
}

static const fmi2CallbackFunctions callbacks = {say, calloc, free, NULL, NULL};

__attribute__((export_name("page_instantiate"))) fmi2Component page_instantiate(const char *guid) {
    return fmi2Instantiate("page", fmi2CoSimulation, guid, "", &callbacks, fmi2True, fmi2True);
}
