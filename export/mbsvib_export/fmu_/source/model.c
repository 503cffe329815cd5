/* The matrices file, read as if somebody had tampered with it: every size, place and number is checked. */
#include "lti.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#ifdef _WIN32
#include <wchar.h>
/* of windows.h, whose names are ours too */
__declspec(dllimport) int __stdcall MultiByteToWideChar(unsigned, unsigned long, const char *, int, wchar_t *, int);
#define CP_UTF8 65001
#endif

#define LIMIT 1000000                  /* of every number of names; sizes stay below 2^62 */
#define HEADER 128                     /* magic 8, checksum of the rest 8, six sizes 48, token 64 */

static FILE *open_file(const char *path)
{
#ifdef _WIN32
    wchar_t wide[4096];
    if (MultiByteToWideChar(CP_UTF8, 0, path, -1, wide, 4096)) return _wfopen(wide, L"rb");
#endif
    return fopen(path, "rb");
}

uint32_t checksum(const unsigned char *bytes, size_t length)
{
    uint32_t table[256], sum = 0xFFFFFFFFu;
    for (uint32_t i = 0; i < 256; i++) {
        table[i] = i;
        for (int k = 0; k < 8; k++) table[i] = table[i] >> 1 ^ (table[i] & 1 ? 0xEDB88320u : 0);
    }
    for (size_t i = 0; i < length; i++) sum = sum >> 8 ^ table[(sum ^ bytes[i]) & 255];
    return sum ^ 0xFFFFFFFFu;
}

static unsigned char *read_file(const char *folder, size_t *length)
{
    size_t end = strlen(folder);
    char path[4352];
    if (end >= 4096) return NULL;
    const char *slash = end && (folder[end - 1] == '/' || folder[end - 1] == '\\') ? "" : "/";
    snprintf(path, sizeof path, "%s%smodel.lti", folder, slash);
    FILE *file = open_file(path);
    unsigned char *bytes = NULL;
    long size;
    if (!file) return NULL;
    if (!fseek(file, 0, SEEK_END) && (size = ftell(file)) >= HEADER && !fseek(file, 0, SEEK_SET)) {
        bytes = malloc((size_t)size);
        if (bytes && fread(bytes, 1, (size_t)size, file) != (size_t)size) { free(bytes); bytes = NULL; }
        *length = (size_t)size;
    }
    fclose(file);
    return bytes;
}

static int finite_all(const double *values, int64_t count)
{
    for (int64_t i = 0; i < count; i++) if (!isfinite(values[i])) return 0;
    return 1;
}

/* places of the blocks of A behind each other */
static const char *place_blocks(Model *model, const int64_t *offset)
{
    if (offset[0] != 0 || offset[model->blocks] != model->n) return "blocks of A do not fit the states";
    for (int64_t k = 0; k < model->blocks; k++) {
        if (offset[k + 1] <= offset[k] || offset[k + 1] > model->n) return "blocks of A do not ascend";
        int64_t rows = offset[k + 1] - offset[k];
        model->start[k + 1] = model->start[k] + rows * rows;
    }
    return NULL;
}

static const char *place_matrices(Model *model, int64_t descriptor)
{
    int64_t n = model->n, m = model->m, p = model->p;
    model->iB = model->start[model->blocks];
    model->iC = model->iB + n * m;
    model->iD = model->iC + p * n;
    model->iE = model->iD + p * m;
    model->iF = model->iE + (descriptor ? n * n : 0);
    model->total = model->iF + (descriptor ? p * n : 0);
    return (descriptor || model->np) && model->blocks > 1 ? "E and parameters go with a single block" : NULL;
}

static const char *check_entries(const Model *model, int64_t entries)
{
    if (model->first[0] != 0 || model->first[model->np] != entries) return "entries of the parameters do not fit";
    for (int64_t k = 0; k < model->np; k++)
        if (model->first[k + 1] < model->first[k] || model->first[k + 1] > entries) return "entries of the parameters do not ascend";
    for (int64_t i = 0; i < entries; i++)
        if (model->at[i] < 0 || model->at[i] >= model->total) return "an entry of a parameter lies outside the matrices";
    return finite_all(model->slope, entries) ? NULL : "a derivative is not finite";
}

static const char *parse(Model *model, unsigned char *bytes, size_t length)
{
    int64_t size[6];                   /* states, inputs, outputs, parameters, blocks, entries * 2 + descriptor */
    uint64_t sum;
    memcpy(&sum, bytes + 8, 8);
    if (memcmp(bytes, "MBSLTI02", 8) || sum != checksum(bytes + 16, length - 16)) return "it is damaged, or of another version";
    memcpy(size, bytes + 16, sizeof size);
    for (int i = 0; i < 5; i++) if (size[i] < 0 || size[i] > LIMIT) return "a size is out of range";
    int64_t words = (int64_t)(length - HEADER) / 8, entries = size[5] >> 1, descriptor = size[5] & 1;
    if (size[5] < 0 || entries > words || length % 8 || size[4] > size[0] || (size[0] && !size[4])) return "a size is out of range";
    memcpy(model->token, bytes + 64, 64);
    model->token[64] = 0;
    model->n = size[0]; model->m = size[1]; model->p = size[2]; model->np = size[3]; model->blocks = size[4];
    int64_t n = model->n, m = model->m, np = model->np, blocks = model->blocks;
    int64_t whole = blocks + 1 + np + 1 + entries, real = 2 * n + m + np + entries;
    if (whole + real > words) return "it is truncated";
    model->offset = (int64_t *)(bytes + HEADER);
    model->first = model->offset + blocks + 1;
    model->at = model->first + np + 1;
    model->x0 = (double *)(model->at + entries);
    model->nominal = model->x0 + n; model->u0 = model->nominal + n; model->p0 = model->u0 + m;
    model->slope = model->p0 + np; model->base = model->slope + entries;
    model->start = calloc((size_t)blocks + 1, sizeof(int64_t));
    if (!model->start) return "memory is short";
    const char *wrong = place_blocks(model, model->offset);
    if (!wrong) wrong = place_matrices(model, descriptor);
    if (!wrong && whole + real + model->total != words) wrong = "its length does not fit its sizes";
    if (!wrong) wrong = check_entries(model, entries);
    if (!wrong && !(finite_all(model->x0, real - entries) && finite_all(model->base, model->total))) wrong = "a number is not finite";
    return wrong;
}

void model_free(Model *model)
{
    free(model->start);
    free(model->storage);
    model->start = NULL;
    model->storage = NULL;
}

const char *model_load(Model *model, const char *folder)
{
    size_t length = 0;
    unsigned char *bytes = read_file(folder, &length);
    if (!bytes) return "it is missing or cannot be read";
    model->storage = bytes;
    return parse(model, bytes, length);
}
