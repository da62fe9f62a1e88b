/* SPDX-License-Identifier: MIT OR Apache-2.0

   lexi_tool decodes a .lexi file by lexi.h alone, and writes a PLY in INRIA's layout.

       lexi_tool FILE [--first BYTES] [--ply OUT.ply] [--verify] [--chunks]

   --first takes only the first bytes of the file. Their Gaussians are written in the order of the file, without
   extras, even where these are there. --verify compares the integers of every range with the CRC-32s of
   the index. --chunks decodes chunk by chunk, as a renderer would, and writes no PLY.
   Exit codes are 0: accepted, 2: wrong usage, 3: a file cannot be read or written, 4: refused as damaged, 6: over a
   limit, 1: no memory. */

#define LEXI_IMPLEMENTATION
#include "lexi.h"

#include <stdio.h>

static int fail(int code, const char *text) {
    fprintf(stderr, "lexi_tool: %s\n", text);
    return code;
}

/* Read at most `most` bytes of a file. Returns NULL if that fails. */
static unsigned char *read_file(const char *path, unsigned long long most, size_t *size, int *is_whole) {
    size_t room = 1 << 16;
    unsigned char *bytes = NULL;
    FILE *in = fopen(path, "rb");
    *size = 0;
    while (in) {
        unsigned char *larger = (unsigned char *)realloc(bytes, room);
        if (!larger) break;
        bytes = larger;
        *size += fread(bytes + *size, 1, room - *size, in);
        if (*size < room || *size > most) {
            if (ferror(in)) break;
            fclose(in);
            *is_whole = *size <= most;
            if (!*is_whole) *size = (size_t)most;
            /* A copy of just this size lets a sanitiser see every access beyond it. */
            bytes = (unsigned char *)realloc(bytes, *size ? *size : 1);
            return bytes;
        }
        room *= 2;
    }
    if (in) fclose(in);
    free(bytes);
    return NULL;
}

static unsigned char *put_bits(unsigned char *out, uint64_t bits, int bytes) {
    for (int k = 0; k < bytes; k++) *out++ = (unsigned char)(bits >> (8 * k));
    return out;
}

static unsigned char *put_float(unsigned char *out, float x) {
    uint32_t bits;
    memcpy(&bits, &x, 4);
    return put_bits(out, bits, 4);
}

static unsigned char *put_floats(unsigned char *out, const float *x, size_t n) {
    for (size_t k = 0; k < n; k++) out = put_float(out, x ? x[k] : 0);
    return out;
}

static unsigned char *put_double(unsigned char *out, double x) {
    uint64_t bits;
    memcpy(&bits, &x, 8);
    return put_bits(out, bits, 8);
}

static void put_names(FILE *out, const char *name, int n) {
    for (int k = 0; k < n; k++) fprintf(out, "property float %s%d\n", name, k);
}

static int write_ply(const char *path, const lexi_info *info, const lexi_scene *s, const lexi_extra *extras,
                     size_t extra_count) {
    static const char *const types[8] = {"char", "uchar", "short", "ushort", "int", "uint", "float", "double"};
    size_t width = (info->has_offset ? 20 : 17) * 4 + (size_t)s->d * 4; /* positions are doubles then */
    int normals = 1;
    unsigned char *row;
    FILE *out = fopen(path, "wb");
    if (!out) return 0;
    fprintf(out, "ply\nformat binary_little_endian 1.0\n");
    if (info->antialiased) fprintf(out, "comment antialiased 1\n");
    fprintf(out, "element vertex %lu\n", (unsigned long)s->count);
    for (int k = 0; k < 3; k++) fprintf(out, "property %s %c\n", info->has_offset ? "double" : "float", 'x' + k);
    for (size_t e = 0; e < extra_count; e++) /* a name is not written twice */
        if (extras[e].name_length == 2 && extras[e].name[0] == 'n' && extras[e].name[1] >= 'x' &&
            extras[e].name[1] <= 'z')
            normals = 0;
    for (int k = 0; normals && k < 3; k++) fprintf(out, "property float n%c\n", 'x' + k);
    put_names(out, "f_dc_", 3);
    put_names(out, "f_rest_", s->d);
    fprintf(out, "property float opacity\n");
    put_names(out, "scale_", 3);
    put_names(out, "rot_", 4);
    for (size_t e = 0; e < extra_count; e++) {
        fprintf(out, "property %s ", types[extras[e].type]);
        fwrite(extras[e].name, 1, extras[e].name_length, out);
        fputc('\n', out);
        width += (size_t)extras[e].width;
    }
    fprintf(out, "end_header\n");
    row = (unsigned char *)malloc(width);
    for (size_t i = 0; row && i < s->count; i++) {
        unsigned char *at = row;
        if (!info->has_offset) at = put_floats(at, s->position + 3 * i, 3);
        else for (int k = 0; k < 3; k++) at = put_double(at, s->position[3 * i + (size_t)k] + info->offset[k]);
        if (normals) at = put_floats(at, s->normal ? s->normal + 3 * i : NULL, 3);
        at = put_floats(at, s->dc + 3 * i, 3);
        at = put_floats(at, s->sh_rest + (size_t)s->d * i, (size_t)s->d);
        at = put_floats(at, s->opacity + i, 1);
        at = put_floats(at, s->scale + 3 * i, 3);
        at = put_floats(at, s->rotation + 4 * i, 4);
        for (size_t e = 0; e < extra_count; e++) {
            size_t w = (size_t)extras[e].width;
            memcpy(at, extras[e].values + w * i, w);
            at += w;
        }
        fwrite(row, 1, (size_t)(at - row), out);
    }
    if (!row || ferror(out)) {
        free(row);
        fclose(out);
        return 0;
    }
    free(row);
    return fclose(out) == 0;
}

/* Whether codes are the same SH-rest as the dense one. */
static int codes_agree(const lexi_info *info, const lexi_scene *s) {
    size_t d = (size_t)s->d;
    for (size_t i = 0; i < s->count; i++) {
        float row[72] = {0};
        size_t first = s->code_first[i];
        if (s->code_count[i] == LEXI_EXACT) memcpy(row, s->exact_rows + first * d, d * sizeof *row);
        else
            for (size_t k = first; k < first + s->code_count[i]; k++)
                for (size_t j = 0; j < d; j++) {
                    volatile float product = s->value[k] * info->dictionary[s->atom[k] * d + j];
                    row[j] += product;
                }
        if (d && memcmp(row, s->sh_rest + i * d, d * sizeof *row)) return 0;
    }
    return 1;
}

int main(int argc, char **argv) {
    const char *path = NULL, *ply = NULL;
    unsigned long long most = ~0ull;
    int verify = 0, by_chunk = 0, is_whole, code = 0;
    size_t size, ranges = 0, gaussians = 0, extra_count = 0;
    lexi_error error = {0, ""};
    lexi_scene scene;
    lexi_extra *extras = NULL;
    for (int i = 1; i < argc; i++) {
        if (!strcmp(argv[i], "--first") && i + 1 < argc) most = strtoull(argv[++i], NULL, 10);
        else if (!strcmp(argv[i], "--ply") && i + 1 < argc) ply = argv[++i];
        else if (!strcmp(argv[i], "--verify")) verify = 1;
        else if (!strcmp(argv[i], "--chunks")) by_chunk = 1;
        else if (argv[i][0] != '-' && !path) path = argv[i];
        else return fail(2, "usage: lexi_tool FILE [--first BYTES] [--ply OUT.ply] [--verify] [--chunks]");
    }
    if (!path) return fail(2, "usage: lexi_tool FILE [--first BYTES] [--ply OUT.ply] [--verify] [--chunks]");
    unsigned char *bytes = read_file(path, most, &size, &is_whole);
    if (!bytes) return fail(3, "the file cannot be read");
    memset(&scene, 0, sizeof scene);
    lexi_file *file = lexi_open(bytes, size, !is_whole, NULL, &error);
    if (!file) {
        free(bytes);
        return fail(error.code, error.text);
    }
    const lexi_info *info = lexi_get_info(file);
    if (info->dictionary_only) printf("a dictionary of %d atoms of degree %d\n", info->m, info->degree);
    else if (by_chunk) {
        for (size_t i = 0; !code && i < info->chunk_count; i++) {
            if (!lexi_decode_chunk(file, i, LEXI_SPARSE, &scene, &error)) code = error.code;
            gaussians += scene.count;
            lexi_free_scene(&scene);
        }
    } else {
        if (!lexi_decode(file, ply || verify ? LEXI_DENSE | LEXI_SPARSE : LEXI_DENSE, &scene, &error))
            code = error.code;
        gaussians = scene.count;
        extras = (lexi_extra *)calloc(info->extra_count + 1, sizeof *extras);
        if (!extras) code = LEXI_NO_MEMORY;
        for (size_t i = 0; !code && is_whole && i < info->extra_count; i++) {
            if (!lexi_decode_extra(file, i, &extras[extra_count], &error)) code = error.code;
            else if (extras[extra_count].values) extra_count++;
        }
        if (!code && is_whole && !lexi_restore_order(file, &scene, extras, extra_count, &error)) code = error.code;
        if (!code && scene.code_first && !codes_agree(info, &scene)) {
            code = 1;
            strcpy(error.text, "codes and dense SH-rest differ");
        }
    }
    if (!code && verify && !lexi_verify_integers(file, &ranges, &error)) code = error.code;
    if (!code && ply && !info->dictionary_only && !by_chunk && !write_ply(ply, info, &scene, extras, extra_count)) {
        code = 3;
        strcpy(error.text, "the PLY cannot be written");
    }
    if (!code) {
        printf("%lu of %lu Gaussians, degree %d, %lu chunks", (unsigned long)gaussians, (unsigned long)info->gaussians,
               info->degree, (unsigned long)info->chunk_count);
        if (verify) printf(", integers of %lu ranges are right", (unsigned long)ranges);
        printf("\n");
    }
    for (size_t i = 0; i < extra_count; i++) lexi_free_extra(&extras[i]);
    free(extras);
    lexi_free_scene(&scene);
    lexi_close(file);
    free(bytes);
    return code ? fail(code, error.text) : 0;
}
