/* Start values that stand beside the binary: a copy of an FMU with others needs no compiler. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <wchar.h>

#include "fmi_common.h"

#ifdef __wasm__ /* there are no files */

Status fmi_read_starts(const FmiInstance *fmu) { return fmu->core == NULL ? ERROR : SUCCESS; }

#else

#ifdef _WIN32 /* windows.h has names of ours */
__declspec(dllimport) int __stdcall MultiByteToWideChar(unsigned page, unsigned long flags, const char *text, int size,
                                                        wchar_t *wide, int wide_size);
enum { CP_UTF8 = 65001 };
#endif

/* Open a file for reading, whose path is in UTF-8. */
static FILE *open_file(const char *path) {
#ifdef _WIN32
    wchar_t wide[4096];
    const int size = (int)(sizeof wide / sizeof *wide);
    return MultiByteToWideChar(CP_UTF8, 0, path, -1, wide, size) > 0 ? _wfopen(wide, L"r") : NULL;
#else
    return fopen(path, "r");
#endif
}

/* Report that the file of start values is damaged. */
static Status damaged(const FmiInstance *fmu) {
    return core_report(fmu->core, ERROR, "%s is damaged: write the archive anew", fmu->starts);
}

/* Read the rest of a line, and set the start values in it. */
static Status read_start(const FmiInstance *fmu, FILE *file, char kind, unsigned reference, size_t count) {
    double *values = count > 0 && count <= SIZE_MAX / sizeof *values ? malloc(count * sizeof *values) : NULL;
    uint64_t bits = 0;
    char digits[17] = "";
    int complete = values != NULL;
    for (size_t i = 0; complete && i < count; i++) {
        complete = fscanf(file, "%16s", digits) == 1 && strlen(digits) == 16 && sscanf(digits, "%" SCNx64, &bits) == 1;
        if (complete) memcpy(&values[i], &bits, sizeof bits);
    }
    const int whole = (int)(int64_t)bits, integer = kind == 'i' && count == 1;
    Status status = ERROR;
    if (complete && kind == 't') status = core_set_table(fmu->core, values, count);
    else if (complete && kind == 'r') status = core_set(fmu->core, &reference, 1, values, count);
    else if (complete && integer) status = core_set_settings(fmu->core, &reference, 1, &whole);
    else damaged(fmu);
    free(values);
    return status == SUCCESS ? SUCCESS : ERROR;
}

Status fmi_read_starts(const FmiInstance *fmu) {
    FILE *file = fmu->starts == NULL ? NULL : open_file(fmu->starts);
    if (file == NULL && fmu->has_starts)
        return core_report(fmu->core, ERROR, "%s cannot be read: this FMU has its start values there", fmu->starts);
    if (file == NULL) return SUCCESS;
    Status status = SUCCESS;
    char kind;
    unsigned reference;
    size_t count;
    int found, zeros = 0;
    while (status == SUCCESS && (found = fscanf(file, " %c %u %zu", &kind, &reference, &count)) != EOF) {
        if (found == 3 && kind == 'z') zeros = 1;
        else status = found == 3 ? read_start(fmu, file, kind, reference, count) : damaged(fmu);
        for (int c = 0; c != '\n' && c != EOF;) c = fgetc(file); /* the name */
    }
    fclose(file);
    return status == SUCCESS && zeros ? core_ignore_zeros(fmu->core) : status;
}

#endif
