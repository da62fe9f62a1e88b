/* SPDX-License-Identifier: MIT OR Apache-2.0

   lexi.h is a reference decoder of .lexi files, compressed scenes of 3D Gaussian Splatting. It was written from
   docs/FORMAT.md alone, whose names it uses; "check 14" is a number of its list of checks. It is one file of C99 and
   needs only the C standard library. One source file of a program includes it after `#define LEXI_IMPLEMENTATION`:

       #define LEXI_IMPLEMENTATION
       #include "lexi.h"

   Other source files include it without. A whole file becomes arrays like this:

       lexi_error error;
       lexi_scene scene;
       lexi_file *file = lexi_open(bytes, size, 0, NULL, &error);
       if (file && lexi_decode(file, LEXI_DENSE, &scene, &error)) { ... lexi_free_scene(&scene); }
       else puts(error.text);
       lexi_close(file);

   All functions of one file are independent of all others: there is no global state. Files may be hostile. No memory
   is taken before the bytes that fill it are known to be there, and a call takes at most `limits.bytes`. Decoding a
   file chunk by chunk (lexi_decode_chunk) needs memory for one chunk of at most 65,536 Gaussians.
   The compiler must keep to IEEE 754, so options like -ffast-math are wrong here. */

#ifndef LEXI_H
#define LEXI_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum { LEXI_NO_MEMORY = 1, LEXI_DAMAGED = 4, LEXI_MISUSE = 5, LEXI_OVER_LIMIT = 6 }; /* lexi_error.code */
enum { LEXI_DENSE = 1, LEXI_SPARSE = 2 };                /* what of SH-rest is wanted, a sum of these or 0 */
enum { LEXI_EXACT = 255 };                               /* in lexi_scene.code_count: SH-rest is an exact row */
enum { LEXI_BASE, LEXI_FINER, LEXI_PART, LEXI_INTERIM }; /* kinds of ranges, see lexi_range.what */

typedef struct lexi_error {
    int code;       /* one of those above */
    char text[240]; /* names the field and the rule that it breaks */
} lexi_error;

/* Limits of the reader. A number of 0 stands for the default. A file that is over one is not damaged. */
typedef struct lexi_limits {
    uint64_t header_bytes; /* of the JSON header; by default 4 MiB */
    uint64_t gaussians;    /* in the file; by default any number */
    uint64_t bytes;        /* of memory that one call takes; by default 64 MiB and 512 times the bytes given */
} lexi_limits;

/* A range of bytes of a packed file. `bytes` is NULL while the range is missing. A program that fetches ranges by
   itself opens a first part, and sets `bytes` (of `length`) as they come in, in any order. They have to stay there. */
typedef struct lexi_range {
    int what, number;            /* LEXI_BASE; LEXI_FINER 1 to 2; LEXI_PART 0 to 2; LEXI_INTERIM */
    uint64_t start;              /* offset in the file */
    uint32_t length, crc, integers_crc;
    const unsigned char *bytes;
} lexi_range;

/* Neighbours in a packed file, and in other layouts up to 65,536 Gaussians in the order of the file. */
typedef struct lexi_chunk {
    uint64_t first;              /* number of its first Gaussian in the file */
    uint32_t count;              /* of Gaussians */
    int layer, finer;            /* its layer, and the layer's number of refinements (R) */
    uint64_t cell;
    float least[3], largest[3];  /* bounds of positions; all 0 in a file of one chunk */
    int range_count;             /* 0 in other layouts than packed */
    lexi_range range[7];         /* in the order of their kinds */
    uint64_t first_code, first_exact;
} lexi_chunk;

typedef struct lexi_file lexi_file;

typedef struct lexi_info {
    int version;                 /* 1 or 3 */
    int dictionary_only;
    int packed;
    uint64_t gaussians;
    int degree, d, m;            /* SH degree, length of SH-rest, atoms */
    const float *dictionary;     /* m rows of d; NULL if m is 0 */
    int antialiased;
    int has_offset;
    double offset[3];            /* what is added to positions to get to the world of the source */
    int layers;
    size_t chunk_count;
    lexi_chunk *chunks;          /* only `bytes` of ranges may be changed */
    size_t extra_count;          /* per-Gaussian properties that 3DGS does not define */
    int has_order;               /* whether lexi_restore_order does something: not in a first part */
} lexi_info;

/* Gaussians. Arrays have `count` rows. SH-rest is channel-major like f_rest_*. */
typedef struct lexi_scene {
    size_t count;
    uint32_t *number;            /* of each Gaussian in the file; those that are not listed are not drawn */
    float *position, *dc;        /* 3 a row */
    float *opacity, *scale;      /* 1 before the sigmoid; 3 natural logarithms */
    float *rotation;             /* w, x, y, z of any length */
    float *normal;               /* 3 a row; NULL if the file has none */
    int d;
    float *sh_rest;              /* LEXI_DENSE: d a row */
    size_t *code_first;          /* LEXI_SPARSE: the first of a Gaussian's entries in `atom` and `value`, ... */
    uint8_t *code_count;         /* ... and their number; or LEXI_EXACT, code_first is then a row of exact_rows */
    size_t code_total, exact_total;
    uint16_t *atom;              /* ascending within a Gaussian */
    float *value;                /* SH-rest is the sum of value times atom, in this order, each rounded to f32 */
    float *exact_rows;           /* d a row */
    size_t code_room, exact_room;
} lexi_scene;

/* A per-Gaussian property: its values, little-endian, in the order of the file. */
typedef struct lexi_extra {
    const char *name;            /* UTF-8, as long as the file is open */
    size_t name_length;
    int type;                    /* 0 I8, 1 U8, 2 I16, 3 U16, 4 I32, 5 U32, 6 F32, 7 F64 */
    int width;                   /* bytes of a value */
    unsigned char *values;       /* to be freed by lexi_free_extra */
} lexi_extra;

/* Open a file or a first part of one, and check all that can be checked before Gaussians are decoded. `bytes` have to
   stay there until lexi_close. `limits` may be NULL. The result is NULL if the file is refused. */
lexi_file *lexi_open(const void *bytes, size_t size, int is_first_part, const lexi_limits *limits, lexi_error *error);
void lexi_close(lexi_file *file);
lexi_info *lexi_get_info(lexi_file *file);

/* Decode all Gaussians that are there, or those of one chunk. Both return 1, or 0 and an error. Gaussians of a packed
   file are decoded with all ranges of their chunk that are there and count. */
int lexi_decode(lexi_file *file, int sh_rest, lexi_scene *scene, lexi_error *error);
int lexi_decode_chunk(lexi_file *file, size_t chunk, int sh_rest, lexi_scene *scene, lexi_error *error);
void lexi_free_scene(lexi_scene *scene);

/* Bring the Gaussians of a whole file, and their extras, into the order of the source. */
int lexi_restore_order(lexi_file *file, lexi_scene *scene, lexi_extra *extras, size_t extra_count, lexi_error *error);

/* Decode an extra, from 0 to extra_count - 1. `values` is NULL afterwards if this is a first part of a file, which has
   no extras. */
int lexi_decode_extra(lexi_file *file, size_t index, lexi_extra *extra, lexi_error *error);
void lexi_free_extra(lexi_extra *extra);

/* Decode every range that is there, and compare CRC-32s of integers with those of the index ("Checksums of
   integers"). A test of decoders needs this, and no program that draws. `ranges` becomes the number of these ranges. */
int lexi_verify_integers(lexi_file *file, size_t *ranges, lexi_error *error);

#ifdef __cplusplus
}
#endif
#endif /* LEXI_H */

#ifdef LEXI_IMPLEMENTATION

#include <math.h>
#include <stdlib.h>
#include <string.h>

#ifndef LEXI_MALLOC
#define LEXI_MALLOC(size) malloc(size)
#define LEXI_REALLOC(pointer, size) realloc(pointer, size)
#define LEXI_FREE(pointer) free(pointer)
#endif

/* Products and sums are rounded on their own: no fused operations. */
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(__GNUC__)
#pragma GCC push_options
#pragma GCC optimize("fp-contract=off")
#elif defined(_MSC_VER)
#pragma fp_contract(off)
#endif

/* ---- Errors, memory, numbers ---- */

typedef struct {
    uint64_t left, most; /* bytes of memory that this call may still take, and may take in all */
    lexi_error *error;
} lexi__call;

static size_t lexi__put(char *out, size_t at, size_t room, const char *text, size_t length) {
    for (size_t i = 0; i < length && at + 1 < room; i++) out[at++] = text[i] >= ' ' && text[i] <= '~' ? text[i] : '?';
    out[at] = 0;
    return at;
}

/* Write an error: the field, a colon, the rule. Signs % in these become the numbers, four at most. Returns 0. */
static int lexi__fail(lexi__call *call, int code, const char *field, const char *rule, const int64_t *numbers) {
    size_t at = 0, used = 0, room = sizeof call->error->text;
    if (!call->error) return 0;
    call->error->code = code;
    for (int part = 0; part < 2; part++) {
        if (part) at = lexi__put(call->error->text, at, room, ": ", 2);
        for (const char *p = part ? rule : field; *p; p++) {
            char digits[24];
            size_t n = sizeof digits;
            if (*p != '%' || used == 4) { at = lexi__put(call->error->text, at, room, p, 1); continue; }
            uint64_t x = numbers[used] < 0 ? 0 - (uint64_t)numbers[used] : (uint64_t)numbers[used];
            do digits[--n] = (char)('0' + x % 10); while (x /= 10);
            if (numbers[used++] < 0) digits[--n] = '-';
            at = lexi__put(call->error->text, at, room, digits + n, sizeof digits - n);
        }
    }
    return 0;
}

static int lexi__damaged(lexi__call *call, const char *field, const char *rule, int64_t a, int64_t b) {
    int64_t numbers[4] = {a, b, 0, 0};
    return lexi__fail(call, LEXI_DAMAGED, field, rule, numbers);
}

static int lexi__refuse(lexi__call *call, const char *field, const char *rule) {
    return lexi__damaged(call, field, rule, 0, 0);
}

static int lexi__misuse(lexi__call *call, const char *field, const char *rule) {
    const int64_t numbers[4] = {0, 0, 0, 0};
    return lexi__fail(call, LEXI_MISUSE, field, rule, numbers);
}

static int lexi__too_large(lexi__call *call, const char *field, const char *rule, uint64_t a, uint64_t b) {
    int64_t numbers[4] = {(int64_t)a, (int64_t)b, 0, 0};
    return lexi__fail(call, LEXI_OVER_LIMIT, field, rule, numbers);
}

/* Refuse with the name of a tensor or of metadata in the field. */
static int lexi__named(lexi__call *call, const char *kind, const char *name, size_t length, const char *rule) {
    char field[100];
    size_t at = lexi__put(field, 0, sizeof field, kind, strlen(kind));
    at = lexi__put(field, at, sizeof field, name, length);
    for (size_t i = 0; i < at; i++) if (field[i] == '%') field[i] = '?';
    return lexi__refuse(call, field, rule);
}

static int lexi__no_memory(lexi__call *call, uint64_t size) {
    int64_t numbers[4] = {(int64_t)size, 0, 0, 0};
    return lexi__fail(call, LEXI_NO_MEMORY, "memory", "% bytes are not to be had", numbers);
}

/* Make `pointer` count * size bytes large. Old memory stays where it was if there is no more. */
static int lexi__resize(lexi__call *call, void *pointer, uint64_t old_count, uint64_t count, size_t size) {
    void *old, *new_memory;
    memcpy(&old, pointer, sizeof old);
    if (count > UINT64_MAX / size || count * size > SIZE_MAX)
        return lexi__too_large(call, "memory", "% times % bytes are needed", count, size);
    if ((count - old_count) * size > call->left)
        return lexi__too_large(call, "memory", "more than % bytes are needed", call->most, 0);
    new_memory = LEXI_REALLOC(old, count ? (size_t)(count * size) : 1);
    if (!new_memory) return lexi__no_memory(call, count * size);
    call->left -= (count - old_count) * size;
    if (count > old_count)
        memset((char *)new_memory + (size_t)(old_count * size), 0, (size_t)((count - old_count) * size));
    memcpy(pointer, &new_memory, sizeof new_memory);
    return 1;
}

/* Make room for `more` behind `used`. Rooms double, so that all copies together take linear time. */
static int lexi__grow(lexi__call *call, void *pointer, size_t *room, size_t used, size_t more, size_t size) {
    size_t wanted = *room < 64 ? 64 : *room;
    while (wanted - used < more) wanted *= 2; /* `used` and `more` are far below SIZE_MAX / 2: memory holds them */
    if (wanted == *room) return 1;
    if (!lexi__resize(call, pointer, *room, wanted, size)) return 0;
    *room = wanted;
    return 1;
}

static uint32_t lexi__u16(const unsigned char *p) { return p[0] | (uint32_t)p[1] << 8; }
static uint32_t lexi__u32(const unsigned char *p) { return lexi__u16(p) | lexi__u16(p + 2) << 16; }
static uint64_t lexi__u64(const unsigned char *p) { return lexi__u32(p) | (uint64_t)lexi__u32(p + 4) << 32; }
static float lexi__float(uint32_t bits) { float x; memcpy(&x, &bits, 4); return x; }
static uint32_t lexi__bits_of(float x) { uint32_t bits; memcpy(&bits, &x, 4); return bits; }
static int lexi__finite(float x) { return (lexi__bits_of(x) & 0x7f800000) != 0x7f800000; }

static float lexi__round(double x) { /* to f32; what is too large becomes infinite */
    if (fabs(x) < 340282356779733661637539395458142568448.0) return (float)x;
    return lexi__float(x < 0 ? 0xff800000 : 0x7f800000);
}

static float lexi__half(uint32_t h) { /* f32 of the bits of an f16 */
    uint32_t sign = (h & 0x8000) << 16, exponent = h >> 10 & 31, mantissa = h & 0x3ff;
    if (exponent == 0) return (sign ? -1.0f : 1.0f) * (float)ldexp(mantissa, -24);
    return lexi__float(sign | (exponent == 31 ? 0x7f800000 : (exponent + 112) << 23) | mantissa << 13);
}

static float lexi__to_half(float x) { /* the nearest f16, of two the even one, as f32 */
    uint32_t bits = lexi__bits_of(x), size = bits & 0x7fffffff;
    if (size < 0x38800000) return (float)ldexp(nearbyint(ldexp(x, 24)), -24); /* multiples of 2^-24 */
    size = (size + 0xfff + (size >> 13 & 1)) & ~(uint32_t)0x1fff;
    return lexi__float((bits & 0x80000000) | (size >= 0x47800000 ? 0x7f800000 : size));
}

static int lexi__bitlength(uint64_t x) { int n = 0; while (x) { n++; x >>= 1; } return n; }
static int32_t lexi__min(int32_t a, int32_t b) { return a < b ? a : b; }
static int32_t lexi__clamp(int32_t x, int32_t least, int32_t most) { return x < least ? least : x > most ? most : x; }
static uint32_t lexi__abs(int32_t x) { return x < 0 ? 0 - (uint32_t)x : (uint32_t)x; }
static int32_t lexi__shift(int32_t x, int n) { return x < 0 ? ~(~x >> n) : x >> n; }               /* floor(x / 2^n) */
static int32_t lexi__signed32(uint32_t x) { return x < 0x80000000 ? (int32_t)x : -(int32_t)~x - 1; }
static int32_t lexi__add(int32_t a, int32_t b) { return lexi__signed32((uint32_t)a + (uint32_t)b); } /* wraps */
static int32_t lexi__multiply(int32_t a, int32_t b) { return lexi__signed32((uint32_t)a * (uint32_t)b); } /* wraps */

/* CRC-32 goes on from an earlier one, at first 0. */
static uint32_t lexi__crc(uint32_t crc, const unsigned char *p, size_t n) {
    static const uint32_t table[16] = {0x00000000, 0x1db71064, 0x3b6e20c8, 0x26d930ac, 0x76dc4190, 0x6b6b51f4,
                                       0x4db26158, 0x5005713c, 0xedb88320, 0xf00f9344, 0xd6d6a3e8, 0xcb61b38c,
                                       0x9b64c2b0, 0x86d3d2d4, 0xa00ae278, 0xbdbdf21c};
    crc = ~crc;
    for (size_t i = 0; i < n; i++) {
        crc ^= p[i];
        crc = crc >> 4 ^ table[crc & 15];
        crc = crc >> 4 ^ table[crc & 15];
    }
    return ~crc;
}

static uint32_t lexi__crc_i32(uint32_t crc, int32_t x) {
    uint32_t u = (uint32_t)x;
    unsigned char bytes[4] = {(unsigned char)u, (unsigned char)(u >> 8), (unsigned char)(u >> 16),
                              (unsigned char)(u >> 24)};
    return lexi__crc(crc, bytes, 4);
}

/* ---- JSON ----

   A text becomes an array of nodes in the order of the text. Members of an object are pairs of a string and a value.
   Strings are decoded in place. Nothing is recursive: `parent` leads back. */

typedef struct { char kind; uint32_t begin, length, parent, next; } lexi__node; /* kind is { [ " 0 t f or n */
typedef struct { const char *s; size_t n; } lexi__text;
typedef struct { uint32_t parent, node; lexi__text name; } lexi__key;
typedef struct { char *text; lexi__node *nodes; size_t count, room; lexi__key *keys; size_t key_count; } lexi__json;

static int lexi__is_digit(const char *s, size_t i, size_t n) { return i < n && s[i] >= '0' && s[i] <= '9'; }

/* Length of the JSON number with which the text begins, 0 if there is none. */
static size_t lexi__number_length(const char *s, size_t n) {
    size_t i = n && s[0] == '-', k;
    if (!lexi__is_digit(s, i, n)) return 0;
    if (s[i] == '0') i++;
    else while (lexi__is_digit(s, i, n)) i++;
    if (i < n && s[i] == '.') {
        if (!lexi__is_digit(s, ++i, n)) return 0;
        while (lexi__is_digit(s, i, n)) i++;
    }
    if (i < n && (s[i] == 'e' || s[i] == 'E')) {
        k = i + 1;
        if (k < n && (s[k] == '+' || s[k] == '-')) k++;
        if (!lexi__is_digit(s, k, n)) return 0;
        for (i = k; lexi__is_digit(s, i, n);) i++;
    }
    return i;
}

/* Length of the UTF-8 character at the begin of a text, 0 if it is none. */
static int lexi__utf8(const unsigned char *s, size_t n, uint32_t *character) {
    static const uint32_t least[5] = {0, 0, 0x80, 0x800, 0x10000};
    int k = !n ? 0 : s[0] < 0x80 ? 1 : s[0] < 0xc0 ? 0 : s[0] < 0xe0 ? 2 : s[0] < 0xf0 ? 3 : s[0] < 0xf8 ? 4 : 0;
    if (!k || (size_t)k > n) return 0;
    *character = k == 1 ? s[0] : s[0] & (0x7fu >> k);
    for (int i = 1; i < k; i++) {
        if ((s[i] & 0xc0) != 0x80) return 0;
        *character = *character << 6 | (s[i] & 0x3f);
    }
    return *character < least[k] || *character > 0x10ffff || (*character >= 0xd800 && *character < 0xe000) ? 0 : k;
}

static int lexi__hex4(const char *s, size_t n, uint32_t *x) {
    *x = 0;
    for (int i = 0; i < 4; i++) {
        char c = (size_t)i < n ? s[i] : ' ';
        if (c >= '0' && c <= '9') *x = *x << 4 | (uint32_t)(c - '0');
        else if ((c | 32) >= 'a' && (c | 32) <= 'f') *x = *x << 4 | (uint32_t)((c | 32) - 'a' + 10);
        else return 0;
    }
    return 1;
}

/* Decode the string whose opening quote is at *at. The decoded one begins behind the quote; it is never longer. */
static const char *lexi__string(char *t, size_t n, size_t *at, uint32_t *length) {
    size_t in = *at + 1, out = in;
    uint32_t c, low;
    while (in < n) {
        if (t[in] == '"') {
            *length = (uint32_t)(out - *at - 1);
            *at = in + 1;
            return NULL;
        }
        if ((unsigned char)t[in] < 0x20) return "a string has a control character";
        if (t[in] != '\\') {
            int k = lexi__utf8((unsigned char *)t + in, n - in, &c);
            if (!k) return "a string is not UTF-8";
            while (k--) t[out++] = t[in++];
            continue;
        }
        const char *codes = "\"\"\\\\//b\bf\fn\nr\rt\t";
        c = in + 1 < n ? (unsigned char)t[in + 1] : 0;
        in += 2;
        if (c != 'u') {
            while (*codes && (unsigned char)*codes != c) codes += 2;
            if (!*codes) return "a string has an unknown escape";
            t[out++] = codes[1];
            continue;
        }
        if (in > n || !lexi__hex4(t + in, n - in, &c)) return "a string has an unknown escape";
        in += 4;
        if (c >= 0xd800 && c < 0xe000) {
            if (c >= 0xdc00 || n - in < 6 || t[in] != '\\' || t[in + 1] != 'u' ||
                !lexi__hex4(t + in + 2, n - in - 2, &low) || low < 0xdc00 || low > 0xdfff)
                return "a string has a lone surrogate";
            c = 0x10000 + ((c - 0xd800) << 10) + (low - 0xdc00);
            in += 6;
        }
        int k = c < 0x80 ? 1 : c < 0x800 ? 2 : c < 0x10000 ? 3 : 4;
        for (int i = k - 1; i > 0; i--) { t[out + (size_t)i] = (char)(0x80 | (c & 0x3f)); c >>= 6; }
        t[out] = (char)(k == 1 ? c : (0xf00u >> k & 0xff) | c);
        out += (size_t)k;
    }
    return "a string has no end";
}

static int lexi__compare(lexi__text a, lexi__text b) {
    int order = memcmp(a.s, b.s, a.n < b.n ? a.n : b.n);
    return order ? order : a.n < b.n ? -1 : a.n > b.n;
}

static int lexi__compare_keys(const void *a, const void *b) {
    const lexi__key *x = (const lexi__key *)a, *y = (const lexi__key *)b;
    return x->parent != y->parent ? (x->parent < y->parent ? -1 : 1) : lexi__compare(x->name, y->name);
}

static lexi__text lexi__node_text(const lexi__json *j, size_t node) {
    lexi__text text = {j->text + j->nodes[node].begin, j->nodes[node].length};
    return text;
}

static void lexi__free_json(lexi__json *j) {
    LEXI_FREE(j->text);
    LEXI_FREE(j->nodes);
    LEXI_FREE(j->keys);
    memset(j, 0, sizeof *j);
}

enum { LEXI__DEPTH = 32 }; /* of arrays and objects of JSON within one another: "Container" */

/* The rule that a text breaks, or NULL. The text is copied before. */
static const char *lexi__parse_nodes(lexi__call *call, lexi__json *j, size_t n, int *failed) {
    enum { VALUE, VALUE_OR_END, KEY, KEY_OR_END, COLON, AFTER } want = VALUE;
    const uint32_t none = UINT32_MAX;
    uint32_t open = none;
    size_t at = 0;
    int depth = 0;
    char *t = j->text;
    for (;;) {
        while (at < n && (t[at] == ' ' || t[at] == '\t' || t[at] == '\n' || t[at] == '\r')) at++;
        if (want == AFTER && open == none) return at == n ? NULL : "something follows the JSON";
        if (at == n) return "the JSON has no end";
        char c = t[at], kind = open == none ? 0 : j->nodes[open].kind;
        if ((c == '}' && kind == '{' && (want == KEY_OR_END || want == AFTER)) ||
            (c == ']' && kind == '[' && (want == VALUE_OR_END || want == AFTER))) {
            j->nodes[open].next = (uint32_t)j->count;
            open = j->nodes[open].parent;
            depth--;
            want = AFTER;
            at++;
        } else if (want == AFTER) {
            if (c != ',') return "there is no comma where one is needed";
            want = kind == '{' ? KEY : VALUE;
            at++;
        } else if (want == COLON) {
            if (c != ':') return "there is no colon where one is needed";
            want = VALUE;
            at++;
        } else { /* a node */
            const char *word = c == 't' ? "true" : c == 'f' ? "false" : "null", *why;
            size_t length = lexi__number_length(t + at, n - at);
            int is_key = want == KEY || want == KEY_OR_END;
            if (is_key && c != '"') return "a name is not a string";
            if (!lexi__grow(call, &j->nodes, &j->room, j->count, 1, sizeof *j->nodes)) { *failed = 1; return ""; }
            lexi__node *node = &j->nodes[j->count];
            node->kind = length ? '0' : c;
            node->parent = open;
            node->begin = (uint32_t)at + (c == '"');
            node->length = (uint32_t)length;
            node->next = (uint32_t)++j->count;
            want = is_key ? COLON : AFTER;
            if (length) at += length;
            else if (c == '"') {
                if ((why = lexi__string(t, n, &at, &node->length)) != NULL) return why;
            } else if (c == '{' || c == '[') {
                if (++depth > LEXI__DEPTH) return "its arrays and objects are more than 32 deep";
                open = (uint32_t)j->count - 1;
                want = c == '{' ? KEY_OR_END : VALUE_OR_END;
                at++;
            } else if (n - at >= strlen(word) && !memcmp(t + at, word, strlen(word))) at += strlen(word);
            else return "there is something that is not JSON";
        }
    }
}

/* Parse a text of JSON below 4 GiB, and refuse objects that name a member twice. */
static int lexi__parse(lexi__call *call, const char *field, lexi__json *j, lexi__text text) {
    size_t i, key;
    int failed = 0;
    const char *why;
    memset(j, 0, sizeof *j);
    if (text.n >= UINT32_MAX) return lexi__refuse(call, field, "its JSON has 4 GiB or more");
    if (!lexi__resize(call, &j->text, 0, text.n, 1)) return 0;
    memcpy(j->text, text.s, text.n);
    why = lexi__parse_nodes(call, j, text.n, &failed);
    if (failed) return 0;
    if (why) return lexi__refuse(call, field, why);
    if (!lexi__resize(call, &j->keys, 0, j->count / 2, sizeof *j->keys)) return 0;
    for (i = 0; i < j->count; i++)
        if (j->nodes[i].kind == '{')
            for (key = i + 1; key < j->nodes[i].next; key = j->nodes[key + 1].next) {
                lexi__key k = {(uint32_t)i, (uint32_t)key, lexi__node_text(j, key)};
                j->keys[j->key_count++] = k;
            }
    qsort(j->keys, j->key_count, sizeof *j->keys, lexi__compare_keys);
    for (i = 1; i < j->key_count; i++)
        if (!lexi__compare_keys(&j->keys[i - 1], &j->keys[i]))
            return lexi__refuse(call, field, "an object of its JSON names a member twice");
    return 1;
}

static int lexi__is(lexi__text text, const char *word) {
    return text.n == strlen(word) && !memcmp(text.s, word, text.n);
}

/* The node of a member of an object, 0 if it has none of that name. */
static size_t lexi__member_of(const lexi__json *j, size_t object, lexi__text name) {
    lexi__key wanted = {(uint32_t)object, 0, name};
    const lexi__key *key = NULL;
    if (j->key_count)
        key = (const lexi__key *)bsearch(&wanted, j->keys, j->key_count, sizeof wanted, lexi__compare_keys);
    return key ? key->node + 1 : 0;
}

static size_t lexi__member(const lexi__json *j, size_t object, const char *name) {
    lexi__text text = {name, strlen(name)};
    return lexi__member_of(j, object, text);
}

/* An integer of digits alone, without leading zeros. */
static int lexi__integer_of(lexi__text t, uint64_t most, uint64_t *x) {
    *x = 0;
    if (!t.n || t.n > 20 || (t.s[0] == '0' && t.n > 1)) return 0;
    for (size_t i = 0; i < t.n; i++) {
        uint64_t digit = (uint64_t)(unsigned char)t.s[i] - '0';
        if (!lexi__is_digit(t.s, i, t.n) || *x > (UINT64_MAX - digit) / 10) return 0;
        *x = 10 * *x + digit;
    }
    return *x <= most;
}

/* A finite number as it is written in JSON. The point is moved into the exponent, since what strtod takes for a point
   depends on the locale. */
static int lexi__number(lexi__call *call, lexi__text t, double *x) {
    char *copy = NULL;
    size_t out = 0, i = 0;
    int64_t exponent = 0, written = 0, point = 0, negative;
    if (!t.n || lexi__number_length(t.s, t.n) != t.n || !lexi__resize(call, &copy, 0, (uint64_t)t.n + 32, 1)) return 0;
    for (; i < t.n && t.s[i] != 'e' && t.s[i] != 'E'; i++) {
        if (t.s[i] == '.') point = 1;
        else { copy[out++] = t.s[i]; exponent -= point; }
    }
    negative = ++i < t.n && t.s[i] == '-';
    for (; i < t.n; i++)
        if (lexi__is_digit(t.s, i, t.n) && written < 100000000000) written = 10 * written + (t.s[i] - '0');
    exponent += negative ? -written : written;
    copy[out++] = 'e';
    if (exponent < 0) { copy[out++] = '-'; exponent = -exponent; }
    for (int64_t unit = 1000000000000; unit; unit /= 10) copy[out++] = (char)('0' + exponent / unit % 10);
    *x = strtod(copy, NULL);
    LEXI_FREE(copy);
    return *x - *x == 0;
}

/* ---- The file ---- */

typedef struct {
    lexi__text name;
    int type, rank, known;
    uint64_t shape[2], count, begin, end; /* the first two numbers of the shape; elements; offsets behind the header */
} lexi__tensor;

typedef struct {
    uint16_t p[256], start[256], w;
    uint8_t symbol[4096];
} lexi__table; /* `symbol` of low bits of a state */

typedef struct { /* packed.head */
    int points, parts, promised, exponent, interim, layers, finer[8];
    uint32_t least[3], interim_step[3], mantissa[5];
    int shift[5];
    float origin[3], side, value_step, dc_mean[3], dc_axes[3][3], softening, point[15][3];
    double dc_unit;      /* of values */
    int32_t cell_log, turn[3][4], move[3][4], means[7], predictor[7][7];
} lexi__head;

struct lexi_file {
    lexi_info info;
    const unsigned char *bytes;
    size_t size;         /* bytes that are there */
    uint64_t whole;      /* bytes of the whole file */
    size_t begin;        /* of tensors */
    lexi_limits limits;
    lexi__json header;
    size_t metadata;     /* the node of it */
    lexi__tensor *tensors;
    size_t tensor_count;
    uint32_t *extras;    /* which tensors are extra properties */
    lexi__text layout;
    float *dictionary;
    lexi_chunk *chunks;
    lexi__head head;
    lexi__table *tables; /* all of the file */
    int16_t table_of[61][24];
};

/* Types of tensors; the first ones are numbered as in coded columns. */
static const char lexi__types[][5] = {"I8",  "U8",  "I16",  "U16",  "I32", "U32", "F32",
                                      "F64", "F16", "BOOL", "BF16", "I64", "U64"};
static const unsigned lexi__type_bytes[] = {1, 1, 2, 2, 4, 4, 4, 8, 2, 1, 2, 8, 8};
enum { LEXI__U8 = 1, LEXI__U16 = 3, LEXI__I32 = 4, LEXI__U32 = 5, LEXI__F32 = 6, LEXI__F16 = 8 };

static lexi__call lexi__begin_call(const lexi_file *f, lexi_error *error) {
    lexi__call call;
    uint64_t most = f->size > (UINT64_MAX >> 10) ? UINT64_MAX : (uint64_t)f->size * 512 + (64 << 20);
    call.left = call.most = f->limits.bytes ? f->limits.bytes : most;
    call.error = error;
    return call;
}

static int lexi__compare_tensors(const void *a, const void *b) {
    const lexi__tensor *x = (const lexi__tensor *)a, *y = (const lexi__tensor *)b;
    return x->begin != y->begin ? (x->begin < y->begin ? -1 : 1) : x->end != y->end ? (x->end < y->end ? -1 : 1)
           : lexi__compare(x->name, y->name);
}

static lexi__tensor *lexi__find(lexi_file *f, const char *name) {
    for (size_t i = 0; i < f->tensor_count; i++) if (lexi__is(f->tensors[i].name, name)) return &f->tensors[i];
    return NULL;
}

static const unsigned char *lexi__data(const lexi_file *f, const lexi__tensor *t) {
    return f->bytes + f->begin + t->begin;
}
static int lexi__is_there(const lexi_file *f, const lexi__tensor *t) { return t->end <= f->size - f->begin; }
static int lexi__begins(lexi__text name, const char *word) {
    return name.n >= strlen(word) && !memcmp(name.s, word, strlen(word));
}

/* One entry of the header. */
static int lexi__read_tensor(lexi__call *call, const lexi__json *j, size_t node, lexi__tensor *t) {
    size_t type = lexi__member(j, node, "dtype"), shape = lexi__member(j, node, "shape"), i;
    size_t offsets = lexi__member(j, node, "data_offsets");
    uint64_t x, width;
    const char *rule = "its entry has no string dtype, list shape or pair data_offsets";
    t->name = lexi__node_text(j, node - 1);
    if (!type || !shape || !offsets || j->nodes[type].kind != '"' || j->nodes[shape].kind != '[' ||
        j->nodes[offsets].kind != '[' || j->nodes[offsets].next != offsets + 3)
        return lexi__named(call, "tensor ", t->name.s, t->name.n, rule);
    for (t->type = 0; !lexi__is(lexi__node_text(j, type), lexi__types[t->type]);)
        if (++t->type == (int)(sizeof lexi__type_bytes / sizeof *lexi__type_bytes))
            return lexi__named(call, "tensor ", t->name.s, t->name.n, "its dtype is unknown");
    t->count = 1;
    for (i = shape + 1; i < j->nodes[shape].next; i++, t->rank++) {
        if (j->nodes[i].kind != '0' || !lexi__integer_of(lexi__node_text(j, i), UINT64_MAX, &x))
            return lexi__named(call, "tensor ", t->name.s, t->name.n, "its shape has something else than integers");
        if (x && t->count > UINT64_MAX / x)
            return lexi__named(call, "tensor ", t->name.s, t->name.n, "its shape is too large");
        t->count *= x;
        if (t->rank < 2) t->shape[t->rank] = x;
    }
    width = lexi__type_bytes[t->type];
    if (j->nodes[offsets + 1].kind != '0' || j->nodes[offsets + 2].kind != '0' ||
        !lexi__integer_of(lexi__node_text(j, offsets + 1), UINT64_MAX, &t->begin) ||
        !lexi__integer_of(lexi__node_text(j, offsets + 2), UINT64_MAX, &t->end) || t->end < t->begin ||
        t->count > UINT64_MAX / width || t->end - t->begin != t->count * width)
        return lexi__named(call, "tensor ", t->name.s, t->name.n, "its data_offsets do not hold its shape");
    return 1;
}

/* Checks 1 and 2. */
static int lexi__open_header(lexi__call *call, lexi_file *f, int is_first_part) {
    uint64_t length, end = 0;
    lexi__text text;
    if (f->size < 9) return lexi__damaged(call, "file", "it has % bytes, a header needs more", f->size, 0);
    length = lexi__u64(f->bytes);
    if (f->bytes[8] != '{')
        return lexi__damaged(call, "header", "byte 8 of the file is %, not a brace", f->bytes[8], 0);
    if (length > f->limits.header_bytes)
        return lexi__too_large(call, "header length L", "it is %, at most % is read", length, f->limits.header_bytes);
    if (length > f->size - 8)
        return lexi__damaged(call, "header length L", "it is %, % bytes follow", length, f->size - 8);
    f->begin = (size_t)length + 8;
    text.s = (const char *)f->bytes + 8;
    text.n = (size_t)length;
    if (!lexi__parse(call, "header", &f->header, text)) return 0;
    const lexi__json *j = &f->header;
    size_t key, count = 0;
    for (key = 1; key < j->nodes[0].next; key = j->nodes[key + 1].next) count++;
    if (!lexi__resize(call, &f->tensors, 0, count, sizeof *f->tensors) ||
        !lexi__resize(call, &f->extras, 0, count, sizeof *f->extras)) return 0;
    for (key = 1; key < j->nodes[0].next; key = j->nodes[key + 1].next) {
        if (lexi__is(lexi__node_text(j, key), "__metadata__")) f->metadata = key + 1;
        else if (!lexi__read_tensor(call, j, key + 1, &f->tensors[f->tensor_count++])) return 0;
    }
    if (!f->metadata || j->nodes[f->metadata].kind != '{')
        return lexi__refuse(call, "__metadata__", "it is not an object");
    for (key = f->metadata + 1; key < j->nodes[f->metadata].next; key = j->nodes[key + 1].next)
        if (j->nodes[key + 1].kind != '"')
            return lexi__named(call, "metadata ", j->text + j->nodes[key].begin, j->nodes[key].length,
                               "it is not a string");
    qsort(f->tensors, f->tensor_count, sizeof *f->tensors, lexi__compare_tensors);
    for (size_t i = 0; i < f->tensor_count; end = f->tensors[i++].end)
        if (f->tensors[i].begin != end)
            return lexi__named(call, "tensor ", f->tensors[i].name.s, f->tensors[i].name.n,
                               "there is a hole or an overlap before it");
    if (end > UINT64_MAX - f->begin) return lexi__refuse(call, "header", "its tensors are too long");
    f->whole = f->begin + end;
    if (f->whole < f->size || (f->whole > f->size && !is_first_part))
        return lexi__damaged(call, "header", "its tensors end at byte % of the file, which has %", f->whole, f->size);
    return 1;
}

/* ---- Metadata ---- */

static int lexi__meta(const lexi_file *f, const char *key, lexi__text *text) {
    size_t node = lexi__member(&f->header, f->metadata, key);
    if (node) *text = lexi__node_text(&f->header, node);
    return node != 0;
}

static int lexi__meta_fail(lexi__call *call, const char *key, const char *rule) {
    return lexi__named(call, "metadata ", key, strlen(key), rule);
}

/* Integers and numbers; `needed` says whether they have to be there. */
static int lexi__meta_integer(lexi__call *call, const lexi_file *f, const char *key, int needed, uint64_t most,
                              uint64_t *x) {
    lexi__text text;
    *x = 0;
    if (!lexi__meta(f, key, &text)) return needed ? lexi__meta_fail(call, key, "it is missing") : 1;
    return lexi__integer_of(text, most, x)
               ? 1
               : lexi__meta_fail(call, key, "it is not an integer in the bounds of this key");
}

static int lexi__meta_number(lexi__call *call, const lexi_file *f, const char *key, int needed) {
    lexi__text text;
    double x;
    if (!lexi__meta(f, key, &text)) return needed ? lexi__meta_fail(call, key, "it is missing") : 1;
    return lexi__number(call, text, &x) && x >= 0
               ? 1
               : lexi__meta_fail(call, key, "it is not a number that is finite and not negative");
}

/* A list of JSON: three numbers for `offset`, else strings. */
static int lexi__meta_list(lexi__call *call, lexi_file *f, const char *key, int needed) {
    lexi__text text;
    lexi__json j;
    int numbers = key[0] == 'o', ok;
    if (!lexi__meta(f, key, &text)) return needed ? lexi__meta_fail(call, key, "it is missing") : 1;
    ok = lexi__parse(call, key, &j, text);
    if (ok && (j.nodes[0].kind != '[' || (numbers && j.nodes[0].next != 4)))
        ok = lexi__meta_fail(call, key, "it is not such a list");
    for (size_t i = 1; ok && i < j.count; i++)
        if (j.nodes[i].kind != (numbers ? '0' : '"') ||
            (numbers && !lexi__number(call, lexi__node_text(&j, i), &f->info.offset[i - 1])))
            ok = lexi__meta_fail(call, key, "its list has something else");
    if (numbers) f->info.has_offset = 1;
    lexi__free_json(&j);
    return ok;
}

/* `target` and `reached`. Kinds of members: number, integer, boolean, string. */
static int lexi__meta_object(lexi__call *call, const lexi_file *f, const char *key) {
    static const char *const names[] = {"0mean_psnr", "0min_psnr", "iviews",      "bcameras",
                                        "skind",      "0asked",    "0judged_psnr"};
    int target = key[0] == 't', ok;
    lexi__text text, value;
    lexi__json j;
    double number;
    uint64_t integer;
    if (!lexi__meta(f, key, &text)) return 1;
    ok = lexi__parse(call, key, &j, text);
    for (int i = 0; ok && i < 7; i++) {
        if (i > 3 && target == (i == 6)) continue;
        size_t node = lexi__member(&j, 0, names[i] + 1);
        char kind = node ? j.nodes[node].kind : 0;
        value = lexi__node_text(&j, node);
        ok = names[i][0] == '0' ? kind == '0' && lexi__number(call, value, &number)
             : names[i][0] == 'i' ? kind == '0' && lexi__integer_of(value, UINT32_MAX, &integer)
             : names[i][0] == 'b' ? kind == 't' || kind == 'f'
             : kind == '"';
        if (!ok) lexi__named(call, target ? "metadata target, member " : "metadata reached, member ", names[i] + 1,
                                  strlen(names[i] + 1), "it is missing or not of its kind");
    }
    lexi__free_json(&j);
    return ok;
}

/* Check 3, and check 8. */
static int lexi__open_metadata(lexi__call *call, lexi_file *f) {
    lexi__text text;
    uint64_t x;
    int scene;
    if (!lexi__meta(f, "format", &text)) return lexi__meta_fail(call, "format", "it is missing");
    f->info.dictionary_only = lexi__is(text, "lexi-dictionary");
    if (!f->info.dictionary_only && !lexi__is(text, "lexi"))
        return lexi__meta_fail(call, "format", "it is neither lexi nor lexi-dictionary");
    scene = !f->info.dictionary_only;
    if (!lexi__meta_integer(call, f, "version", 1, UINT64_MAX, &x)) return 0;
    if (x > 3) return lexi__damaged(call, "metadata version", "it is %, the newest known one is %", x, 3);
    if (x != 1 && (x != 3 || !scene))
        return lexi__damaged(call, "metadata version", "it is %, which no such file has", x, 0);
    f->info.version = (int)x;
    int v1 = x == 1;
    if (scene) {
        if (!lexi__meta(f, "layout", &f->layout)) {
            if (v1) return lexi__meta_fail(call, "layout", "it is missing");
            f->layout.s = "packed";
            f->layout.n = 6;
        }
        f->info.packed = lexi__is(f->layout, "packed");
        if (f->info.packed == v1 ||
            (v1 && !lexi__is(f->layout, "f32") && !lexi__is(f->layout, "f16") && !lexi__is(f->layout, "paper")))
            return lexi__meta_fail(call, "layout", "it is none of this version");
    }
    if (!lexi__meta_integer(call, f, "degree", 1, 4, &x)) return 0;
    f->info.degree = (int)x;
    f->info.d = (f->info.degree + 1) * (f->info.degree + 1) * 3 - 3;
    if (v1 && !lexi__meta(f, "checksums", &text)) return lexi__meta_fail(call, "checksums", "it is missing");
    if (!scene) return 1;
    if (v1 && (!lexi__meta(f, "pursuit", &text) || (!lexi__is(text, "omp") && !lexi__is(text, "ols"))))
        return lexi__meta_fail(call, "pursuit", "it is neither omp nor ols");
    if (lexi__meta(f, "antialiased", &text)) f->info.antialiased = lexi__is(text, "true");
    else if (v1) return lexi__meta_fail(call, "antialiased", "it is missing");
    else text.s = "false", text.n = 5;
    if (!f->info.antialiased && !lexi__is(text, "false"))
        return lexi__meta_fail(call, "antialiased", "it is neither true nor false");
    if (!lexi__meta_integer(call, f, "max_nonzeros", 0, 255, &x) ||
        !lexi__meta_integer(call, f, "seed", v1, UINT64_MAX, &x) ||
        !lexi__meta_integer(call, f, "over_tolerance", v1, UINT64_MAX, &x) ||
        !lexi__meta_number(call, f, "max_residual", v1) || !lexi__meta_number(call, f, "rms_residual", v1) ||
        !lexi__meta_number(call, f, "tolerance", 0) || !lexi__meta_list(call, f, "comments", v1) ||
        !lexi__meta_list(call, f, "offset", 0))
        return 0;
    if (v1) return 1;
    if (!lexi__meta_integer(call, f, "removed", 0, UINT64_MAX, &x) || !lexi__meta_object(call, f, "target") ||
        !lexi__meta_object(call, f, "reached")) return 0;
    return lexi__meta_integer(call, f, "gaussians", 1, UINT32_MAX - 1, &f->info.gaussians);
}

/* Check 4: the CRC-32s of `checksums`, which has all tensors but those of the header and the packed ones. */
static int lexi__check_sums(lexi__call *call, lexi_file *f) {
    lexi__text text = {"{}", 2};
    lexi__json j;
    size_t named = 0, i, node;
    int ok;
    lexi__meta(f, "checksums", &text);
    ok = lexi__parse(call, "metadata checksums", &j, text);
    if (ok && j.nodes[0].kind != '{') ok = lexi__meta_fail(call, "checksums", "it is not an object");
    if (ok) for (i = 1; i < j.nodes[0].next; i = j.nodes[i + 1].next) named++;
    for (i = 0; ok && i < f->tensor_count; i++) {
        const lexi__tensor *t = &f->tensors[i];
        uint32_t crc = 0;
        if (f->info.packed ? lexi__is(t->name, "packed.head") || lexi__is(t->name, "packed.data")
                           : lexi__is(t->name, "checksum.header"))
            continue;
        node = lexi__member_of(&j, 0, t->name);
        ok = node && j.nodes[node].kind == '"' && j.nodes[node].length == 8;
        for (int k = 0; ok && k < 8; k++) {
            char c = j.text[j.nodes[node].begin + (uint32_t)k];
            ok = (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f');
            crc = crc << 4 | (uint32_t)(c <= '9' ? c - '0' : c - 'a' + 10);
        }
        if (!ok)
            lexi__named(call, "metadata checksums, ", t->name.s, t->name.n,
                        "there are no eight lower-case hexadecimal digits");
        else if (lexi__is_there(f, t) && lexi__crc(0, lexi__data(f, t), (size_t)(t->end - t->begin)) != crc)
            ok = lexi__named(call, "tensor ", t->name.s, t->name.n, "its CRC-32 is not that of checksums");
        named--;
    }
    if (ok && named) ok = lexi__meta_fail(call, "checksums", "it names something that has no checksum there");
    lexi__free_json(&j);
    return ok;
}

/* ---- Tensors of all layouts ---- */

/* Whether a name may follow "extra.": check 5. */
static int lexi__is_property(lexi__text t) {
    static const char *const taken[] = {"x",       "y",       "z",       "f_dc_0", "f_dc_1", "f_dc_2", "opacity",
                                        "scale_0", "scale_1", "scale_2", "rot_0",  "rot_1",  "rot_2",  "rot_3"};
    uint32_t c = 0;
    size_t digits = 7;
    for (size_t i = 0; i < sizeof taken / sizeof *taken; i++) if (lexi__is(t, taken[i])) return 0;
    while (lexi__is_digit(t.s, digits, t.n)) digits++;
    if (t.n > 7 && digits == t.n && lexi__begins(t, "f_rest_")) return 0;
    for (size_t i = 0; i < t.n;) {
        i += (size_t)lexi__utf8((const unsigned char *)t.s + i, t.n - i, &c);
        if (c <= 0x20 || (c >= 0x7f && c <= 0xa0) || c == 0x1680 || (c >= 0x2000 && c <= 0x200a) || c == 0x2028 ||
            c == 0x2029 || c == 0x202f || c == 0x205f || c == 0x3000)
            return 0; /* white space and Cc */
    }
    return t.n > 0;
}

/* Bytes of a value of a coded column, 0 if its type is unknown or not there. */
static size_t lexi__column_width(const lexi_file *f, const lexi__tensor *t) {
    unsigned type = t->end > t->begin && lexi__is_there(f, t) ? lexi__data(f, t)[0] : 8;
    return type < 8 ? lexi__type_bytes[type] : 0;
}

/* Take the tensor of a name. Its type and shape have to be these; the second number is 0 for a shape of one. */
static int lexi__take(lexi__call *call, lexi_file *f, const char *name, int type, uint64_t rows, uint64_t columns,
                      lexi__tensor **result) {
    lexi__tensor *t = *result = lexi__find(f, name);
    if (!t) return lexi__named(call, "tensor ", name, strlen(name), "it is missing");
    if (t->type != type)
        return lexi__named(call, "tensor ", name, strlen(name), "its dtype is not that of this layout");
    if (t->rank != (columns ? 2 : 1) || t->shape[0] != rows || (columns && t->shape[1] != columns))
        return lexi__named(call, "tensor ", name, strlen(name),
                           "its shape does not fit the other tensors or the metadata");
    t->known = 1;
    return 1;
}

/* Check what is left when the tensors of a layout have been taken. Extras together take no more memory than a call. */
static int lexi__check_names(lexi__call *call, lexi_file *f) {
    uint64_t left = call->left, size;
    for (size_t i = 0; i < f->tensor_count; i++) {
        lexi__tensor *t = &f->tensors[i];
        lexi__text name = t->name;
        if (t->known || lexi__begins(name, "x-")) continue;
        if (f->info.dictionary_only || !lexi__begins(name, "extra."))
            return lexi__named(call, "tensor ", name.s, name.n, "it is unknown in this layout");
        name.s += 6;
        name.n -= 6;
        if (!lexi__is_property(name))
            return lexi__named(call, "tensor extra.", name.s, name.n, "no extra property may have this name");
        if (t->rank != 1 || (f->info.packed ? t->type != LEXI__U8 : t->shape[0] != f->info.gaussians || t->type > 7))
            return lexi__named(call, "tensor extra.", name.s, name.n,
                               "its dtype or shape is not that of an extra property");
        size = !f->info.packed ? t->end - t->begin : f->info.gaussians * lexi__column_width(f, t);
        if (size > left)
            return lexi__too_large(call, "memory", "extra properties need more than % bytes", call->left, 0);
        left -= size;
        f->extras[f->info.extra_count++] = (uint32_t)i;
    }
    return 1;
}

static float lexi__float_at(const unsigned char *p, uint64_t i) { return lexi__float(lexi__u32(p + 4 * i)); }

/* ---- Layouts f32, f16 and paper, and dictionaries ---- */

static int lexi__take_dictionary(lexi__call *call, lexi_file *f) {
    lexi__tensor *t = lexi__find(f, "dictionary");
    uint64_t m = t ? t->shape[0] : 0, d = (uint64_t)f->info.d;
    if (!d) return f->info.dictionary_only ? lexi__meta_fail(call, "degree", "a dictionary has no degree 0") : 1;
    if (t && (m < 1 || m > 1024))
        return lexi__damaged(call, "tensor dictionary", "it has % atoms, 1 to % are allowed", m, 1024);
    if (!lexi__take(call, f, "dictionary", LEXI__F32, m, d, &t) ||
        !lexi__resize(call, &f->dictionary, 0, m * d, sizeof(float)))
        return 0;
    for (uint64_t i = 0; i < m; i++) {
        double sum = 0;
        for (uint64_t k = 0; k < d; k++) {
            float x = f->dictionary[i * d + k] = lexi__float_at(lexi__data(f, t), i * d + k);
            sum += (double)x * x; /* not finite if x is not */
        }
        if (!(fabs(sqrt(sum) - 1) <= 1e-5))
            return lexi__damaged(call, "tensor dictionary", "the norm of atom % is not 1", i, 0);
    }
    f->info.m = (int)m;
    return 1;
}

/* Number of nonzeros of Gaussian i. Pointers have been checked. */
static uint32_t lexi__plain_count(const lexi_file *f, const unsigned char *counts, uint64_t i) {
    return lexi__is(f->layout, "paper") ? lexi__u32(counts + 4 * i + 4) - lexi__u32(counts + 4 * i) : counts[i];
}

static int lexi__open_plain(lexi__call *call, lexi_file *f) {
    lexi__tensor *t = lexi__find(f, "position"), *counts = NULL, *indices, *values, *escapes = NULL, *rows;
    uint64_t n = t ? t->shape[0] : 0, d = (uint64_t)f->info.d, total = 0, k = 0, e = 0, exact = 0, i;
    int paper = lexi__is(f->layout, "paper"), f16 = lexi__is(f->layout, "f16"), index_type;
    if (f->size < f->whole)
        return lexi__damaged(call, "file", "it has % of its % bytes, and only packed files have first parts", f->size,
                             f->whole);
    if (!lexi__take(call, f, "checksum.header", LEXI__U32, 1, 0, &t)) return 0;
    if (lexi__crc(0, f->bytes, f->begin) != lexi__u32(lexi__data(f, t)))
        return lexi__refuse(call, "tensor checksum.header", "it is not the CRC-32 of the header");
    if (!lexi__check_sums(call, f)) return 0;
    if (!lexi__take_dictionary(call, f)) return 0;
    if (f->info.dictionary_only) return lexi__check_names(call, f);
    if (n >= UINT32_MAX)
        return lexi__damaged(call, "tensor position", "it has % Gaussians, at most 2^32 - 2 are allowed", n, 0);
    f->info.gaussians = n;
    if (!lexi__take(call, f, "position", LEXI__F32, n, 3, &t) || !lexi__take(call, f, "dc", LEXI__F32, n, 3, &t) ||
        !lexi__take(call, f, "scale", LEXI__F32, n, 3, &t) || !lexi__take(call, f, "opacity", LEXI__F32, n, 0, &t) ||
        !lexi__take(call, f, "rotation", LEXI__F32, n, 4, &t)) return 0;
    if (lexi__find(f, "normal") && !lexi__take(call, f, "normal", LEXI__F32, n, 3, &t)) return 0;
    if (d) {
        index_type = paper ? LEXI__I32 : f->info.m <= 256 ? LEXI__U8 : LEXI__U16;
        total = (t = lexi__find(f, "codes.indices")) != NULL ? t->shape[0] : 0;
        if (!lexi__take(call, f, paper ? "codes.pointers" : "codes.counts", paper ? LEXI__I32 : LEXI__U8,
                        n + (uint64_t)paper, 0, &counts) ||
            !lexi__take(call, f, "codes.indices", index_type, total, 0, &indices) ||
            !lexi__take(call, f, "codes.values", f16 ? LEXI__F16 : LEXI__F32, total, 0, &values))
            return 0;
        if (lexi__find(f, "escapes.gaussians") || lexi__find(f, "escapes.rows")) {
            e = (t = lexi__find(f, "escapes.gaussians")) != NULL ? t->shape[0] : 0;
            if (!lexi__take(call, f, "escapes.gaussians", LEXI__U32, e, 0, &escapes) ||
                !lexi__take(call, f, "escapes.rows", LEXI__F32, e, d, &rows)) return 0;
        }
    }
    if (!lexi__check_names(call, f)) return 0;
    if (f->limits.gaussians && n > f->limits.gaussians)
        return lexi__too_large(call, "tensor position", "it has % Gaussians, at most % are read", n,
                               f->limits.gaussians);
    /* Check 7, but for indices. */
    for (i = 0; i < e; i++) {
        uint32_t g = lexi__u32(lexi__data(f, escapes) + 4 * i);
        if (g >= n || (i && g <= lexi__u32(lexi__data(f, escapes) + 4 * i - 4)))
            return lexi__damaged(call, "tensor escapes.gaussians", "entry % is not ascending or not below N", i, 0);
    }
    if (paper && counts && lexi__u32(lexi__data(f, counts)))
        return lexi__refuse(call, "tensor codes.pointers", "the first one is not 0");
    f->info.chunk_count = (size_t)((n + 65535) / 65536);
    if (!lexi__resize(call, &f->chunks, 0, f->info.chunk_count, sizeof *f->chunks)) return 0;
    for (i = 0; i < n; i++) {
        lexi_chunk *chunk = &f->chunks[i / 65536];
        uint32_t count = counts ? lexi__plain_count(f, lexi__data(f, counts), i) : 0;
        if (chunk->count++ == 0) {
            chunk->first = i;
            chunk->first_code = k;
            chunk->first_exact = exact;
        }
        if (count > d)
            return lexi__damaged(call, paper ? "tensor codes.pointers" : "tensor codes.counts",
                                 "Gaussian % has more than % nonzeros, or fewer than 0", i, d);
        k += count;
        if (exact < e && lexi__u32(lexi__data(f, escapes) + 4 * exact) == i) {
            if (count) return lexi__damaged(call, "tensor escapes.gaussians", "Gaussian % has nonzeros too", i, 0);
            exact++;
        }
    }
    if (k != total || (paper && k > INT32_MAX))
        return lexi__damaged(call, "tensor codes.indices", "it has % entries, the counts sum to %", total, k);
    return 1;
}

/* ---- Words of 16 bits: adaptive bits, and lanes of symbols ---- */

typedef struct { const unsigned char *p; size_t words, next; uint32_t state; } lexi__coder;
typedef struct { uint16_t zero; uint8_t seen; } lexi__bit_model;
enum { LEXI__EITHER = 18 }; /* models of `either`: nonzero, negative, lengths[16] */

static int lexi__start(lexi__coder *c, const unsigned char *p, size_t words) {
    c->p = p;
    c->words = words;
    c->next = 2;
    c->state = words < 2 ? 0 : lexi__u16(p) << 16 | lexi__u16(p + 2);
    return c->state >= 0x10000;
}

/* Words beyond the last are taken as 0. Callers look at `next` before they make anything of what they got. */
static void lexi__refill(lexi__coder *c) {
    if (c->state >= 0x10000) return;
    c->state = c->state << 16 | (c->next < c->words ? lexi__u16(c->p + 2 * c->next) : 0);
    c->next++;
}

static int lexi__ended(const lexi__coder *c) { return c->next == c->words && c->state == 0x10000; }

static int lexi__split(lexi__coder *c, uint32_t p) {
    uint32_t low = c->state & 4095, high = c->state >> 12;
    int b = low >= p;
    c->state = b ? high * (4096 - p) + low - p : high * p + low;
    lexi__refill(c);
    return b;
}

static int lexi__bit(lexi__coder *c, lexi__bit_model *model) {
    static const uint8_t rates[6] = {1, 2, 3, 4, 4, 5};
    int b = lexi__split(c, model->zero), rate = rates[model->seen];
    model->zero = (uint16_t)lexi__clamp(
        b ? model->zero - (model->zero >> rate) : model->zero + ((4096 - model->zero) >> rate), 48, 4048);
    if (model->seen < 5) model->seen++;
    return b;
}

static int32_t lexi__even(lexi__coder *c, int n) {
    int32_t x = 0;
    while (n--) x = 2 * x + lexi__split(c, 2048);
    return x;
}

static int32_t lexi__positive(lexi__coder *c, lexi__bit_model *list, int length) {
    int n = 1;
    while (n < length && lexi__bit(c, &list[n])) n++;
    return (int32_t)1 << (n - 1) | lexi__even(c, n - 1);
}

static int32_t lexi__either(lexi__coder *c, lexi__bit_model *models) {
    int negative;
    if (!lexi__bit(c, &models[0])) return 0;
    negative = lexi__bit(c, &models[1]);
    int32_t x = lexi__positive(c, models + 2, 16);
    return negative ? -x : x;
}

static void lexi__even_models(lexi__bit_model *models, size_t n) {
    for (size_t i = 0; i < n; i++) { models[i].zero = 2048; models[i].seen = 0; }
}

/* ---- packed.head ---- */

typedef struct { const unsigned char *p, *end; const char *field, *why; } lexi__cursor; /* with the first fault */

static uint64_t lexi__bad(lexi__cursor *c, const char *field, const char *why) {
    if (!c->why) { c->field = field; c->why = why; c->p = c->end; }
    return 0;
}

static const unsigned char *lexi__bytes(lexi__cursor *c, const char *field, size_t n) {
    if (n > (size_t)(c->end - c->p)) { lexi__bad(c, field, "goes beyond the end"); return NULL; }
    c->p += n;
    return c->p - n;
}

static uint32_t lexi__fixed(lexi__cursor *c, const char *field, size_t n) { /* of 1 to 4 bytes */
    const unsigned char *p = lexi__bytes(c, field, n);
    uint32_t x = 0;
    for (size_t k = p ? n : 0; k; k--) x = x << 8 | p[k - 1];
    return x;
}

static float lexi__real(lexi__cursor *c, const char *field, size_t n) { /* an f32, or the n high bytes of one */
    float x = lexi__float(lexi__fixed(c, field, n) << (32 - 8 * n));
    if (!lexi__finite(x)) { lexi__bad(c, field, "is not finite"); return 0; }
    return x;
}

static uint64_t lexi__varint(lexi__cursor *c, const char *field, int bits) {
    uint64_t x = 0;
    for (int shift = 0;; shift += 7) {
        uint64_t byte = lexi__fixed(c, field, 1);
        if (c->why) return 0;
        if (shift >= bits || (byte & 127) > (UINT64_MAX >> (64 - bits)) >> shift)
            return lexi__bad(c, field, "is too large a varint");
        x |= (byte & 127) << shift;
        if (byte < 128) return byte || !shift ? x : lexi__bad(c, field, "is a varint whose last byte is 0");
    }
}

/* The integers are numbers of `either` times 2^zeros, in groups. */
static int lexi__read_integers(lexi__call *call, lexi__head *h, const unsigned char *p, size_t n) {
    int32_t *list[89], count = 0;
    static const uint8_t sizes[15] = {1, 3, 9, 3, 9, 7, 7, 7, 7, 7, 6, 5, 4},
                         zeros[13] = {2, 2, 4, 2, 4, 2, 2, 4, 4, 4, 4, 4, 4};
    lexi__coder c;
    lexi__bit_model models[LEXI__EITHER];
    list[count++] = &h->cell_log;
    for (int which = 0; which < 2; which++) {
        int32_t(*rows)[4] = which ? h->move : h->turn;
        for (int k = 0; k < 3; k++) list[count++] = &rows[k][0];
        for (int k = 0; k < 9; k++) list[count++] = &rows[k / 3][k % 3 + 1];
    }
    for (int t = 0; t < 7; t++) list[count++] = &h->means[t];
    for (int k = 0; k < 7; k++)
        for (int t = k < 4 ? 0 : k - 3; t < 7; t++) list[count++] = &h->predictor[t][k];
    if (n % 2 || !lexi__start(&c, p, n / 2))
        return lexi__refuse(call, "packed.head, integers", "they are no words with a first state of at least 2^16");
    for (int group = 0, i = 0; group < 13; group++) {
        lexi__even_models(models, LEXI__EITHER);
        for (int k = 0; k < sizes[group]; k++, i++) {
            int32_t x = lexi__either(&c, models) * (1 << zeros[group]);
            if (x < -32768 || x > 32767)
                return lexi__damaged(call, "packed.head, integers", "number % is %, beyond 16 bits", i, x);
            *list[i] = x;
        }
    }
    return lexi__ended(&c) ? 1 : lexi__refuse(call, "packed.head, integers", "their words do not end with them");
}

/* Make probabilities of levels. */
static void lexi__make_table(lexi__table *t, int w, int symbols, const uint8_t *occurs, const int32_t *level) {
    uint32_t weights[256], sum = 0, n = 0, total = 0, largest = 0, at = 0;
    for (int s = 0; s < symbols; s++) {
        int up = 2 * w - level[s];
        weights[s] = occurs[s] ? (up & 1 ? 45u : 32u) << (up >> 1) : 0;
        sum += weights[s];
        n += occurs[s];
    }
    for (int s = 0; s < symbols; s++) {
        t->p[s] = (uint16_t)(occurs[s] ? 1 + weights[s] * ((1u << w) - n) / sum : 0);
        total += t->p[s];
        if (t->p[s] > t->p[largest]) largest = (uint32_t)s;
    }
    t->p[largest] = (uint16_t)(t->p[largest] + (1u << w) - total);
    t->w = (uint16_t)w;
    for (int s = 0; s < symbols; s++) {
        t->start[s] = (uint16_t)at;
        memset(t->symbol + at, s, t->p[s]);
        at += t->p[s];
    }
}

/* Check 11. Sets 51 to 53 are those of Atom0 to Atom2. */
static int lexi__read_tables(lexi__call *call, lexi_file *f, const unsigned char *p, size_t n) {
    lexi__coder c;
    lexi__bit_model used[2], many, same[2], newer, counts[10], present[2], delta[LEXI__EITHER];
    size_t count = 0, room = 0;
    int has = 0;
    lexi__even_models(used, 2);
    lexi__even_models(&many, 1);
    lexi__even_models(same, 2);
    lexi__even_models(&newer, 1);
    lexi__even_models(counts, 10);
    lexi__even_models(present, 2);
    lexi__even_models(delta, LEXI__EITHER);
    if (n % 2 || !lexi__start(&c, p, n / 2))
        return lexi__refuse(call, "packed.head, tables", "they are no words with a first state of at least 2^16");
    for (int set = 0; set < 61; set++) {
        int tables = 1, last = 0, changed = 0, several, w = set >= 51 && set <= 53 ? 12 : 10;
        for (int context = 0; context < 24; context++) f->table_of[set][context] = -1;
        has = lexi__bit(&c, &used[has]);
        if (!has) continue;
        several = lexi__bit(&c, &many);
        f->table_of[set][0] = (int16_t)count;
        for (int context = 1; context < 24; context++) {
            if (several) {
                changed = lexi__bit(&c, &same[changed]);
                if (changed && lexi__bit(&c, &newer)) last = tables++;
                else if (changed) last = lexi__even(&c, lexi__bitlength((uint64_t)tables - 1));
                if (last >= tables)
                    return lexi__damaged(call, "packed.head, tables", "set % names table %, which it does not have",
                                         set, last);
            }
            f->table_of[set][context] = (int16_t)(count + (size_t)last);
        }
        for (int table = 0; table < tables; table++) {
            uint8_t occurs[256];
            int32_t level[256], symbols = lexi__positive(&c, counts, 10);
            if (symbols > 256)
                return lexi__damaged(call, "packed.head, tables",
                                     "a table of set % has % symbols, at most 256 are allowed", set, symbols);
            for (int i = 0; i < symbols; i++) {
                occurs[i] = i == symbols - 1 ? 1 : (uint8_t)lexi__bit(&c, &present[i == 0 || occurs[i - 1]]);
                level[i] = i == 0 ? lexi__even(&c, 5) : level[i - 1];
                if (i && occurs[i]) level[i] += lexi__either(&c, delta);
                if (level[i] < 0 || level[i] > 2 * w)
                    return lexi__damaged(call, "packed.head, tables", "a level of set % is %, 0 to 2w are allowed", set,
                                         level[i]);
            }
            if (c.next > c.words) return lexi__refuse(call, "packed.head, tables", "they go beyond their words");
            if (!lexi__grow(call, &f->tables, &room, count, 1, sizeof *f->tables)) return 0;
            lexi__make_table(&f->tables[count++], w, symbols, occurs, level);
        }
    }
    return lexi__ended(&c) ? 1 : lexi__refuse(call, "packed.head, tables", "their words do not end with them");
}

/* Check 12. */
static int lexi__read_dictionary(lexi__call *call, lexi_file *f, int fixed, const unsigned char *p, size_t n) {
    const double s = 0.5773502691896257, t = 0.7071067811865476, u = 0.4082482904638631, v = 0.8164965809277261;
    size_t d = (size_t)f->info.d, third = d / 3, learned = (size_t)f->info.m - (fixed ? d : 0);
    lexi__bit_model models[4][3][5][LEXI__EITHER];
    lexi__coder c;
    if (!learned && n)
        return lexi__damaged(call, "packed.head, dictionary", "it has % bytes, but no atom is learned", n, 0);
    if (!lexi__resize(call, &f->dictionary, 0, (uint64_t)f->info.m * d, sizeof(float))) return 0;
    lexi__even_models(models[0][0][0], sizeof models / sizeof(lexi__bit_model));
    if (learned && (n % 2 || !lexi__start(&c, p, n / 2)))
        return lexi__refuse(call, "packed.head, dictionary", "it is no words with a first state of at least 2^16");
    for (size_t i = 0; i < learned; i++) {
        int32_t x[26][3] = {{0}}; /* x[k + 2] is coefficient k */
        double atom[72], sum = 0;
        for (size_t k = 0; k < third; k++) {
            int32_t(*now)[3] = &x[k + 2];
            for (int a = 0; a < 3; a++) {
                uint32_t near = lexi__abs(now[-1][a]) + (a ? lexi__abs(now[0][0]) >> 1 : lexi__abs(now[-2][0]));
                now[0][a] = lexi__either(&c, models[k < 3    ? 0
                                                  : k < 8  ? 1
                                                  : k < 15 ? 2
                                                           : 3][a][lexi__min(lexi__bitlength(near), 4)]);
                if (lexi__abs(now[0][a]) > 32767)
                    return lexi__damaged(call, "packed.head, dictionary", "a number of atom % is %, beyond 15 bits", i,
                                         now[0][a]);
            }
            double x0 = now[0][0] * s, x1 = now[0][1] * t, x2 = now[0][2];
            atom[k] = x0 + x1 + x2 * u;
            atom[third + k] = x0 - x2 * v;
            atom[2 * third + k] = x0 - x1 + x2 * u;
        }
        if (c.next > c.words)
            return lexi__damaged(call, "packed.head, dictionary", "atom % goes beyond its words", i, 0);
        for (size_t k = 0; k < d; k++) sum += atom[k] * atom[k];
        if (sum == 0) atom[0] = sum = 1;
        sum = sqrt(sum);
        for (size_t k = 0; k < d; k++) f->dictionary[i * d + k] = (float)(atom[k] / sum);
    }
    if (learned && !lexi__ended(&c))
        return lexi__refuse(call, "packed.head, dictionary", "its words do not end with it");
    for (size_t i = 0; fixed && i < d; i++) {
        const double colours[3][3] = {{s, s, s}, {t, 0, -t}, {u, -v, u}};
        for (size_t channel = 0; channel < 3; channel++)
            f->dictionary[(learned + i) * d + channel * third + i % third] = (float)colours[i / third][channel];
    }
    return 1;
}

static void lexi__make_axes(lexi__head *h, const int32_t *turn) {
    int64_t w = turn[0], x = turn[1], y = turn[2], z = turn[3], n = w * w + x * x + y * y + z * z;
    int64_t rows[3][3] = {{w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)},
                          {2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)},
                          {2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z}};
    h->dc_unit = ldexp(1, h->exponent - 20);
    for (int k = 0; k < 9; k++) h->dc_axes[k / 3][k % 3] = (float)((double)rows[k / 3][k % 3] / (double)n);
}

/* Index, and where in the file each range is. */
static int lexi__read_index(lexi__call *call, lexi_file *f, lexi__cursor *c, const lexi__tensor *data) {
    lexi__head *h = &f->head;
    uint32_t layers = lexi__fixed(c, "number of layers", 1), sorted = layers >> 7, last_layer = 0;
    uint64_t count, gaussians = 0, ranges = 0, start = 0;
    h->layers = f->info.layers = (int)(layers & 127);
    if (h->layers > 8)
        return lexi__damaged(call, "packed.head, index", "it has % layers, at most 8 are allowed", h->layers, 0);
    for (int i = 0; i < h->layers; i++)
        if ((h->finer[i] = (int)lexi__fixed(c, "R", 1)) > 2)
            return lexi__damaged(call, "packed.head, index", "layer % has % refinements, at most 2 are allowed", i,
                                 h->finer[i]);
    count = lexi__varint(c, "number of chunks", 32);
    if (count > (uint64_t)(c->end - c->p) / 3)
        return lexi__damaged(call, "packed.head, index",
                             c->why ? "it goes beyond the end" : "it has % chunks, which go beyond the end", count, 0);
    f->info.chunk_count = (size_t)count;
    if (!lexi__resize(call, &f->chunks, 0, count, sizeof *f->chunks)) return 0;
    for (size_t i = 0; i < count && !c->why; i++) {
        lexi_chunk *chunk = &f->chunks[i];
        uint32_t layer = lexi__fixed(c, "layer of a chunk", 1);
        chunk->first = gaussians;
        chunk->count = (uint32_t)lexi__varint(c, "Gaussians of a chunk", 32);
        chunk->cell = lexi__varint(c, "cell of a chunk", 64);
        for (int k = 0; count > 1 && k < 6; k++)
            *(k < 3 ? &chunk->least[k] : &chunk->largest[k - 3]) = lexi__real(c, "bounds of a chunk", 2);
        if (c->why) break;
        if (layer >= (uint32_t)h->layers || layer < last_layer)
            return lexi__damaged(call, "packed.head, index", "chunk % has layer %, which falls or is not there", i,
                                 layer);
        if (chunk->count < 1 || chunk->count > 65536)
            return lexi__damaged(call, "packed.head, index", "chunk % has % Gaussians, 1 to 65536 are allowed", i,
                                 chunk->count);
        if (i && layer == last_layer && chunk->cell < chunk[-1].cell)
            return lexi__damaged(call, "packed.head, index", "the cell of chunk % is below that of the one before", i,
                                 0);
        last_layer = layer;
        gaussians += chunk->count;
        chunk->layer = (int)layer;
        chunk->finer = h->finer[layer];
        for (int what = LEXI_BASE; what <= LEXI_INTERIM; what++) {
            int n = what == LEXI_BASE    ? 1
                    : what == LEXI_FINER ? chunk->finer
                    : what == LEXI_PART  ? h->parts
                                         : h->interim && (int)layer < h->layers - 1;
            for (int k = 0; k < n; k++) {
                chunk->range[chunk->range_count].what = what;
                chunk->range[chunk->range_count++].number = what == LEXI_FINER ? k + 1 : k;
                ranges++;
            }
        }
    }
    size_t at = 0;
    int kind = 0;
    for (uint64_t i = 0; i < ranges && !c->why; i++) {
        if (!sorted) {
            at = (size_t)lexi__varint(c, "chunk of a range", 32);
            kind = (int)lexi__fixed(c, "kind of a range", 1);
        } else if (kind == f->chunks[at].range_count) { at++; kind = 0; }
        if (c->why) break;
        if (at >= count || kind >= f->chunks[at].range_count)
            return lexi__damaged(call, "packed.head, index", "it names range % of chunk %, which is not there", kind,
                                 at);
        lexi_range *range = &f->chunks[at].range[kind++];
        if (range->start)
            return lexi__damaged(call, "packed.head, index", "it names range % of chunk % twice", kind - 1, at);
        if (kind > 1 && !f->chunks[at].range[0].start)
            return lexi__damaged(call, "packed.head, index", "it names range % of chunk % before its base", kind - 1,
                                 at);
        range->length = (uint32_t)lexi__varint(c, "bytes of a range", 32);
        range->crc = lexi__fixed(c, "CRC-32 of a range", 4);
        range->integers_crc = lexi__fixed(c, "CRC-32 of integers", 4);
        range->start = f->begin + data->begin + start; /* at least 9 */
        start += range->length;
        if (range->start + range->length <= f->size) range->bytes = f->bytes + range->start;
        if (kind == 1 && (uint64_t)range->length * 8 < (uint64_t)f->chunks[at].count * 3)
            return lexi__damaged(call, "packed.head, index",
                                 "the base of chunk % has % bytes, less than 3 bits for each Gaussian", at,
                                 range->length);
    }
    if (c->why) return 1; /* the caller reports it */
    if (gaussians != f->info.gaussians)
        return lexi__damaged(call, "packed.head, index", "its chunks have % Gaussians, the metadata say %", gaussians,
                             f->info.gaussians);
    if (start != data->end - data->begin)
        return lexi__damaged(call, "packed.head, index", "its ranges have % bytes, packed.data has %", start,
                             (data->end - data->begin));
    return 1;
}

/* Check 10, and tensors of the layout packed. */
static int lexi__open_packed(lexi__call *call, lexi_file *f) {
    lexi__tensor *head = lexi__find(f, "packed.head"), *data = lexi__find(f, "packed.data"),
                 *order = lexi__find(f, "packed.order");
    lexi__head *h = &f->head;
    const unsigned char *blocks[3];
    size_t lengths[3];
    int32_t turn[4];
    uint64_t x;
    if (!lexi__take(call, f, "packed.head", LEXI__U8, head ? head->shape[0] : 0, 0, &head) ||
        !lexi__take(call, f, "packed.data", LEXI__U8, data ? data->shape[0] : 0, 0, &data) ||
        (order && !lexi__take(call, f, "packed.order", LEXI__U8, order->shape[0], 0, &order)) ||
        !lexi__check_names(call, f))
        return 0;
    f->info.has_order = order && f->size == f->whole;
    if (!lexi__is_there(f, head)) return lexi__refuse(call, "tensor packed.head", "it is not there as a whole");
    lexi__cursor c = {lexi__data(f, head), lexi__data(f, head) + (size_t)(head->end - head->begin), NULL, NULL};
    uint32_t crc = lexi__fixed(&c, "CRC-32", 4);
    if (c.why || lexi__crc(lexi__crc(0, f->bytes, f->begin), c.p, (size_t)(c.end - c.p)) != crc)
        return lexi__refuse(call, "packed.head", "its CRC-32 is wrong");
    if (!lexi__check_sums(call, f)) return 0;
    if (f->limits.gaussians && f->info.gaussians > f->limits.gaussians)
        return lexi__too_large(call, "metadata gaussians", "it is %, at most % is read", f->info.gaussians,
                               f->limits.gaussians);
    if ((f->info.gaussians + 2) / 3 > f->whole)
        return lexi__damaged(call, "metadata gaussians", "it is %, over 3 times the % bytes of the file",
                             f->info.gaussians, f->whole);

    x = lexi__varint(&c, "m", 32);
    uint32_t flags = lexi__fixed(&c, "flags", 1), d = (uint32_t)f->info.d;
    int fixed = flags >> 7;
    h->points = flags & 15;
    h->parts = flags >> 4 & 3;
    h->promised = flags >> 6 & 1;
    if (d ? x < 1 || x > 1024 : x != 0)
        return lexi__damaged(call, "packed.head", "m is %, 1 to 1024 is allowed, and at degree 0 only 0", x, 0);
    if ((d != 0) != (h->parts != 0))
        return lexi__damaged(call, "packed.head", "P is %, 1 to 3 is allowed, and at degree 0 only 0", h->parts, 0);
    if (fixed && (!d || x < d))
        return lexi__damaged(call, "packed.head", "m is %, too few for the % fixed atoms, or the degree is 0", x, d);
    f->info.m = (int)x;
    h->exponent = (int)lexi__fixed(&c, "dc_exponent", 1);
    h->interim = h->exponent >> 7;
    h->exponent &= 127;
    if (h->exponent > 100)
        return lexi__damaged(call, "packed.head", "dc_exponent is %, at most 100 is allowed", h->exponent, 0);
    for (int p = 0; p < h->parts; p++) {
        h->least[p] = p < h->parts - 1 ? lexi__fixed(&c, "least", 1) : 1;
        if (!c.why && ((p && h->least[p] >= h->least[p - 1]) || (p < h->parts - 1 && h->least[p] < 2)))
            return lexi__damaged(call, "packed.head", "least of part % is %, but is above 1 and falls", p, h->least[p]);
    }
    for (int k = 0; h->interim && k < 3; k++) {
        h->interim_step[k] = (uint32_t)lexi__varint(&c, "interim_step", 32);
        if (!c.why && (h->interim_step[k] < 1 || h->interim_step[k] > 1u << 26))
            return lexi__damaged(call, "packed.head", "interim_step[%] is %, 1 to 2^26 is allowed", k,
                                 h->interim_step[k]);
    }
    for (int k = 0; k < 3; k++) h->origin[k] = lexi__real(&c, "origin", 4);
    h->side = lexi__real(&c, "side", 4);
    if (!c.why && !(h->side > 0)) return lexi__refuse(call, "packed.head", "side is not above 0");
    h->value_step = lexi__real(&c, "value_step", 4);
    if (!c.why && !(h->value_step > 0)) return lexi__refuse(call, "packed.head", "value_step is not above 0");
    for (int k = 0; k < 3; k++) h->dc_mean[k] = lexi__real(&c, "dc_mean", 4);
    for (int k = 0; k < 4; k++) turn[k] = (int32_t)(lexi__fixed(&c, "dc_turn", 2) ^ 0x8000) - 0x8000;
    if (!c.why && !turn[0] && !turn[1] && !turn[2] && !turn[3])
        return lexi__refuse(call, "packed.head", "dc_turn is all 0");
    if (h->points) h->softening = lexi__real(&c, "softening", 4);
    if (!c.why && h->points && (h->softening < ldexp(1, -60) || h->softening > ldexp(1, 60)))
        return lexi__refuse(call, "packed.head", "softening is not from 2^-60 to 2^60");
    for (int k = 0; k < 3 * h->points; k++) h->point[k / 3][k % 3] = lexi__real(&c, "points", 3);
    for (int k = 0; k < 5; k++) {
        h->mantissa[k] = lexi__fixed(&c, "steps", 2);
        h->shift[k] = (int)(lexi__fixed(&c, "steps", 1) ^ 0x80) - 0x80;
        if (!c.why && (h->shift[k] < -6 || h->shift[k] > 31))
            return lexi__damaged(call, "packed.head", "the shift of step % is %, -6 to 31 is allowed", k, h->shift[k]);
    }
    for (int k = 0; k < 3; k++) {
        static const char *const names[3] = {"integers", "tables", "dictionary"};
        lengths[k] = (size_t)lexi__varint(&c, names[k], 32);
        blocks[k] = lexi__bytes(&c, names[k], lengths[k]);
    }
    if (c.why) return lexi__named(call, "packed.head, ", c.field, strlen(c.field), c.why);
    lexi__make_axes(h, turn);
    if (!lexi__read_integers(call, h, blocks[0], lengths[0]) || !lexi__read_tables(call, f, blocks[1], lengths[1]) ||
        !lexi__read_dictionary(call, f, fixed, blocks[2], lengths[2]) || !lexi__read_index(call, f, &c, data)) return 0;
    if (c.why) return lexi__named(call, "packed.head, index, ", c.field, strlen(c.field), c.why);
    if (c.p != c.end) return lexi__damaged(call, "packed.head", "% bytes follow the index", (c.end - c.p), 0);
    return 1;
}

lexi_file *lexi_open(const void *bytes, size_t size, int is_first_part, const lexi_limits *limits, lexi_error *error) {
    lexi_file *f = (lexi_file *)LEXI_MALLOC(sizeof *f);
    lexi__call call = {0, 0, error};
    if (!f) {
        lexi__no_memory(&call, sizeof *f);
        return NULL;
    }
    memset(f, 0, sizeof *f);
    f->bytes = (const unsigned char *)bytes;
    f->size = size;
    if (limits) f->limits = *limits;
    if (!f->limits.header_bytes) f->limits.header_bytes = 4 << 20;
    call = lexi__begin_call(f, error);
    if (lexi__open_header(&call, f, is_first_part) && lexi__open_metadata(&call, f) &&
        (f->info.packed ? lexi__open_packed(&call, f) : lexi__open_plain(&call, f))) {
        f->info.dictionary = f->info.m ? f->dictionary : NULL;
        f->info.chunks = f->chunks;
        return f;
    }
    lexi_close(f);
    return NULL;
}

void lexi_close(lexi_file *f) {
    if (!f) return;
    lexi__free_json(&f->header);
    LEXI_FREE(f->tensors);
    LEXI_FREE(f->extras);
    LEXI_FREE(f->dictionary);
    LEXI_FREE(f->chunks);
    LEXI_FREE(f->tables);
    LEXI_FREE(f);
}

lexi_info *lexi_get_info(lexi_file *f) { return &f->info; }

/* ---- Ranges ---- */

typedef struct { /* what the ranges of a chunk say of a Gaussian */
    uint64_t z;
    int32_t cell[3], count[10], predicted[7], move_log[3], change[5];
    uint32_t rotation[3];
    uint8_t colour, shape, needle, full[3], fineness[3], exact, nonzeros[3];
} lexi__gaussian;

typedef struct { /* a chunk while it is decoded */
    lexi__call *call;
    const lexi_file *f;
    const lexi_chunk *chunk;
    const lexi_range *range;         /* that is decoded now */
    size_t index;                    /* of the chunk */
    lexi__gaussian *g;
    uint16_t *atoms[3];              /* nonzeros of each part, in coded order */
    int32_t *sizes[3];
    size_t nonzeros[3], atom_room[3], size_room[3];
    uint32_t *rows;                  /* bits of exact rows, back to back */
    size_t row_numbers, row_room;
    int no_table;                    /* a set without tables was used */
} lexi__work;

typedef struct { /* a lane while it is decoded */
    lexi__coder c;
    uint32_t last;                                       /* count of the Gaussian before, in part 0 */
    int gap_bits, neighbours;
    int32_t cell[16][3], feature[16][9];                 /* of the last 16 Gaussians */
    uint64_t z;
} lexi__lane;

static int lexi__range_fail(lexi__work *x, const char *rule, int64_t a, int64_t b) {
    static const char *const fields[4] = {"packed.data, chunk %, base", "packed.data, chunk %, refinement %",
                                          "packed.data, chunk %, part % of SH-rest",
                                          "packed.data, chunk %, interim changes"};
    int named = x->range->what == LEXI_FINER || x->range->what == LEXI_PART;
    int64_t numbers[4] = {(int64_t)x->index, named ? x->range->number : a, named ? a : b, b};
    return lexi__fail(x->call, LEXI_DAMAGED, fields[x->range->what], rule, numbers);
}

static int lexi__range_refuse(lexi__work *x, const char *rule) { return lexi__range_fail(x, rule, 0, 0); }

static uint32_t lexi__symbol(lexi__work *x, lexi__coder *c, int set, uint32_t context) {
    int index = x->f->table_of[set][context];
    if (index < 0) { x->no_table = 1; return 0; }
    const lexi__table *t = &x->f->tables[index];
    uint32_t low = c->state & ((1u << t->w) - 1), s = t->symbol[low];
    c->state = (c->state >> t->w) * t->p[s] + low - t->start[s];
    lexi__refill(c);
    return s;
}

static uint64_t lexi__raw(lexi__coder *c, int n) { /* bits(n) */
    uint64_t b = 0;
    for (int at = 0; n > 0; at += 16, n -= 16) {
        int piece = n < 16 ? n : 16;
        b |= (uint64_t)(c->state & ((1u << piece) - 1)) << at;
        c->state >>= piece;
        lexi__refill(c);
    }
    return b;
}

static uint64_t lexi__integer(lexi__work *x, lexi__coder *c, int set, uint32_t context, int most) {
    uint32_t t = lexi__symbol(x, c, set, context);
    if (t < 16) return t;
    int n = lexi__min((int32_t)(t - 16) / 2 + 3, most);
    return ((uint64_t)(2 + t % 2) << n) + lexi__raw(c, n);
}

static int32_t lexi__signed(lexi__work *x, lexi__coder *c, int set, uint32_t context) {
    uint32_t u = (uint32_t)lexi__integer(x, c, set, context, 30);
    return u & 1 ? -(int32_t)(u >> 1) - 1 : (int32_t)(u >> 1);
}

static int32_t lexi__drop(int32_t bits, int lack) { return lexi__min(lack == 0 ? 0 : lack + 1, bits - 1); }

static int32_t lexi__step(const lexi__head *h, int t, int class_) {
    int k = t < 4 ? t : 4, up = class_ - h->shift[k];
    uint32_t x = up >= 0 ? h->mantissa[k] << lexi__min(up, 6) : h->mantissa[k] >> -up;
    return lexi__clamp((int32_t)x, 1, 3 << 19);
}

static int32_t lexi__level(int32_t x) { return lexi__clamp(lexi__shift(x + 256, 9), 0, 15); }

static int32_t lexi__slope(const int32_t *row, const lexi__gaussian *g, const int32_t *s) {
    return row[0] + 512 * g->shape + lexi__shift(row[1] * s[0], 12) + lexi__shift(row[2] * s[1], 12) +
           lexi__shift(row[3] * s[2], 12);
}

/* Step 2: weighted averages of neighbours. */
static void lexi__around(const lexi__head *h, const lexi__lane *l, const int32_t *cell, int32_t *around) {
    int32_t sums[9] = {0}, total = 0, inverse;
    int bits;
    if (!l->neighbours) {
        for (int j = 0; j < 9; j++) around[j] = j < 7 ? h->means[j] : 0;
        return;
    }
    for (int i = 0; i < lexi__min(l->neighbours, 16); i++) {
        int32_t square = 0, weight;
        for (int k = 0; k < 3; k++) {
            int32_t distance = lexi__min((int32_t)lexi__abs(cell[k] - l->cell[i][k]), 1023);
            square += distance * distance;
        }
        for (weight = 1 << 11; weight > 1 && 4 * square + 1 >= 4096 / weight; weight >>= 1) {}
        total += weight;
        for (int j = 0; j < 9; j++) sums[j] += weight * l->feature[i][j];
    }
    bits = lexi__bitlength((uint64_t)total);
    inverse = (int32_t)(0x80000000u / (uint32_t)(total << (16 - bits)));
    for (int j = 0; j < 9; j++) around[j] = lexi__shift(lexi__shift(sums[j] + (1 << (bits - 1)), bits) * inverse, 15);
}

static int lexi__base(lexi__work *x, lexi__lane *l, lexi__gaussian *g) {
    const lexi__head *h = &x->f->head;
    lexi__coder *c = &l->c;
    int finer = x->chunk->finer, sets = 16 * finer, known = l->neighbours > 0;
    int32_t around[9], coarse_unit = finer == 2 ? 9 : finer == 1 ? 3 : 1, expected, below, *s, s_[3] = {0};
    /* Cell. */
    uint64_t gap = lexi__integer(x, c, sets, (uint32_t)lexi__min(l->gap_bits, 23), 61);
    g->z = l->z += gap;
    if (l->z >> 63) return lexi__range_refuse(x, "Z is not below 2^63");
    l->gap_bits = lexi__bitlength(gap);
    for (int b = 0; b < 63; b++) g->cell[b % 3] |= (int32_t)(g->z >> b & 1) << b / 3;
    if (g == x->g && g->z != x->chunk->cell)
        return lexi__range_refuse(x, "the cell of the first Gaussian is not that of the index");
    /* Classes. */
    lexi__around(h, l, g->cell, around);
    int32_t colour = (int32_t)lexi__symbol(x, c, sets + 1, known ? 1 + (uint32_t)lexi__level(around[7]) : 0), shape;
    if (colour > 15) return lexi__range_fail(x, "a colour class is %, at most 15 is allowed", colour, 0);
    expected = lexi__clamp(512 * colour + around[8], 0, 15 * 512);
    below = lexi__shift(expected - 128, 9) * 512;
    shape = lexi__add(lexi__level(expected),
                      lexi__signed(x, c, sets + 2, known ? 1 + (uint32_t)lexi__level(2 * (expected - below)) : 0));
    if (shape < 0 || shape > 15) return lexi__range_fail(x, "a shape class is %, 0 to 15 is allowed", shape, 0);
    g->colour = (uint8_t)colour;
    g->shape = (uint8_t)shape;
    /* Targets. */
    int32_t *f = l->feature[l->neighbours % 16];
    s = s_;
    for (int t = 0; t < 7; t++) {
        static const uint8_t streams[7] = {3, 4, 5, 6, 11, 12, 13};
        const int32_t F[6] = {around[t], 512 * colour, 512 * shape, s[0], s[1], s[2]}, *P = h->predictor[t];
        int32_t class_ = t < 4 ? shape : colour, sum = P[0] * 256, coarse;
        for (int k = 1; k < 7; k++) sum += lexi__shift(P[k] * F[k - 1], 4);
        g->predicted[t] = lexi__clamp(sum, -(1 << 25), 1 << 25) * 8;
        g->count[t] = lexi__signed(x, c, sets + streams[t], (uint32_t)class_);
        coarse = lexi__add(g->predicted[t], lexi__multiply(lexi__multiply(g->count[t], t < 4 ? 1 : coarse_unit),
                                                           lexi__step(h, t, class_)));
        f[t] = lexi__clamp(lexi__shift(coarse, 11), -16383, 16383);
        if (t < 3) s[t] = f[t];
    }
    f[7] = 512 * colour;
    f[8] = 512 * (shape - colour);
    memcpy(l->cell[l->neighbours % 16], g->cell, sizeof g->cell);
    l->neighbours = l->neighbours == 31 ? 16 : l->neighbours + 1; /* modulo 16, but not 0 again */
    /* Bits of the rotation, steps of moves. */
    int32_t q[3];
    for (int k = 0; k < 3; k++) {
        q[k] = lexi__min(lexi__slope(h->turn[k], g, s), 135);
        g->move_log[k] = lexi__min(lexi__slope(h->move[k], g, s), 512 + lexi__shift(739 * s[0], 9));
        g->fineness[k] = (uint8_t)lexi__clamp(lexi__shift(h->cell_log - g->move_log[k] + 1152, 8), 0, 23);
    }
    g->needle = s[0] - s[1] >= s[1] - s[2];
    g->full[0] = g->full[1] =
        (uint8_t)lexi__clamp(lexi__shift(677 - lexi__shift(q[1] + (g->needle ? q[2] : q[0]), 1) + 255, 9), 0, 15);
    g->full[2] = (uint8_t)lexi__clamp(lexi__shift(846 - (g->needle ? q[0] : q[2]) + 255, 9), 0, 15);
    for (int k = 0; k < 3; k++) g->rotation[k] = (uint32_t)lexi__raw(c, g->full[k] - lexi__drop(g->full[k], finer));
    for (int k = 0; k < 3; k++) g->count[7 + k] = lexi__signed(x, c, sets + 8 + k, g->fineness[k]);
    return 1;
}

static int lexi__finer(lexi__work *x, lexi__lane *l, lexi__gaussian *g) {
    int lack = x->chunk->finer + 1 - x->range->number;
    for (int j = 4; j < 10; j++) {
        uint32_t size = lexi__abs(g->count[j]),
                 context = 3 * (j < 7 ? g->colour / 2u : g->fineness[j - 7] / 3u) + (size < 2 ? size : 2);
        int32_t t = (int32_t)lexi__symbol(x, &l->c, 16 * lack + (j < 7 ? 15 : 14), context);
        if (t > 2) return lexi__range_fail(x, "a symbol is %, at most 2 is allowed", t, 0);
        g->count[j] = lexi__add(lexi__multiply(3, g->count[j]), g->count[j] >= 0 ? t - 1 : 1 - t);
    }
    for (int j = 0; j < 3; j++) {
        int more = lexi__drop(g->full[j], lack) - lexi__drop(g->full[j], lack - 1);
        g->rotation[j] = g->rotation[j] << more | (uint32_t)lexi__raw(&l->c, more);
    }
    return 1;
}

static void lexi__interim(lexi__work *x, lexi__lane *l, lexi__gaussian *g) {
    g->change[0] = lexi__signed(x, &l->c, 58, g->shape / 2u);
    uint32_t size = lexi__abs(g->change[0]);
    g->change[1] = lexi__signed(x, &l->c, 59, 8 * (size < 2 ? size : 2) + g->shape / 2u);
    for (uint32_t k = 2; k < 5; k++) g->change[k] = lexi__signed(x, &l->c, 60, 8 * (k - 2) + g->colour / 2u);
}

/* A block of up to 64 Gaussians of a part of SH-rest. */
static int lexi__part(lexi__work *x, lexi__lane *l, lexi__gaussian *g, uint32_t n) {
    const lexi__head *h = &x->f->head;
    lexi__coder *c = &l->c;
    int p = x->range->number;
    uint32_t d = (uint32_t)x->f->info.d, m = (uint32_t)x->f->info.m;
    size_t begin = x->nonzeros[p], at = begin, exact = 0;
    uint64_t room = (p ? h->least[p - 1] : 1u << 30) - h->least[p];
    for (uint32_t i = 0; i < n; i++) {
        uint32_t before = p ? g[i].nonzeros[p - 1] : 0, count, all;
        if (g[i].exact) continue;
        count = (uint32_t)lexi__integer(x, c, 48 + p, p ? 3 * (g[i].colour / 2u) + (before < 2 ? before : 2)
                                                        : 2 * (uint32_t)lexi__min(g[i].colour, 11) + (l->last > 1), 30);
        all = count + (p > 0 ? g[i].nonzeros[0] : 0u) + (p > 1 ? g[i].nonzeros[1] : 0u);
        if (count == d + 1 && p == 0) { g[i].exact = 1; exact++; count = 0;
        } else if (count > d || all > d)
            return lexi__range_fail(x, "a Gaussian has % nonzeros, at most % are allowed", count > d ? count : all, d);
        g[i].nonzeros[p] = (uint8_t)count;
        l->last = count;
        at += count;
    }
    if (!lexi__grow(x->call, &x->atoms[p], &x->atom_room[p], begin, at - begin, sizeof(uint16_t)) ||
        !lexi__grow(x->call, &x->sizes[p], &x->size_room[p], begin, at - begin, sizeof(int32_t)) ||
        !lexi__grow(x->call, &x->rows, &x->row_room, x->row_numbers, exact * d, sizeof(uint32_t))) return 0;
    at = begin;
    for (uint32_t i = 0; i < n; i++) {
        uint32_t count = g[i].exact ? 0 : g[i].nonzeros[p];
        uint64_t excess = 0;
        for (uint32_t k = 0; k < count; k++) {
            uint32_t page = m > 256 ? lexi__symbol(x, c, 57, (uint32_t)p) : 0, atom;
            atom = 256 * page + lexi__symbol(x, c, 51 + p, 2 * (uint32_t)lexi__min((int32_t)page, 3) + (k > 0));
            excess = lexi__integer(x, c, 54 + p,
                                   k ? 8 + (excess < 15 ? (uint32_t)excess : 15)
                                     : (uint32_t)lexi__min((int32_t)count - 1, 7),
                                   30);
            if (atom >= m) return lexi__range_fail(x, "an atom is %, the dictionary has %", atom, m);
            if (excess >= room) return lexi__range_fail(x, "an excess is %, below % is allowed", excess, room);
            x->atoms[p][at] = (uint16_t)atom;
            x->sizes[p][at++] = (int32_t)(h->least[p] + excess);
        }
    }
    for (size_t k = begin; k < at; k += 16) {
        int some = at - k < 16 ? (int)(at - k) : 16;
        uint32_t negative = (uint32_t)lexi__raw(c, some);
        for (int b = 0; b < some; b++) if (negative >> b & 1) x->sizes[p][k + (size_t)b] *= -1;
    }
    x->nonzeros[p] = at;
    if (c->next > c->words) return 1; /* the caller reports it */
    for (size_t k = 0; k < exact * d; k++) {
        uint32_t bits = (uint32_t)lexi__raw(c, 32);
        if (!lexi__finite(lexi__float(bits))) return lexi__range_refuse(x, "an exact row is not finite");
        x->rows[x->row_numbers++] = bits;
    }
    return 1;
}

/* CRC-32 of the integers of the range that was decoded last. */
static uint32_t lexi__integers_crc(const lexi__work *x) {
    uint32_t crc = 0, d = (uint32_t)x->f->info.d;
    size_t nonzero = 0, row = 0;
    for (uint32_t i = 0; i < x->chunk->count; i++) {
        const lexi__gaussian *g = &x->g[i];
        int what = x->range->what, p = x->range->number;
        if (what == LEXI_BASE) {
            for (int k = 0; k < 3; k++) crc = lexi__crc_i32(crc, g->cell[k]);
            crc = lexi__crc_i32(lexi__crc_i32(crc, g->colour), g->shape);
        }
        if (what == LEXI_BASE || what == LEXI_FINER) {
            for (int k = 0; k < 10; k++) crc = lexi__crc_i32(crc, g->count[k]);
            for (int k = 0; k < 3; k++) crc = lexi__crc_i32(crc, (int32_t)g->rotation[k]);
        } else if (what == LEXI_INTERIM) {
            for (int k = 0; k < 5; k++) crc = lexi__crc_i32(crc, g->change[k]);
        } else if (g->exact && p == 0) {
            crc = lexi__crc_i32(crc, -1);
            for (uint32_t k = 0; k < d; k++) crc = lexi__crc_i32(crc, lexi__signed32(x->rows[row++]));
        } else {
            crc = lexi__crc_i32(crc, g->nonzeros[p]);
            for (int k = 0; k < g->nonzeros[p]; k++, nonzero++)
                crc = lexi__crc_i32(lexi__crc_i32(crc, x->atoms[p][nonzero]), x->sizes[p][nonzero]);
        }
    }
    return crc;
}

/* Check 14. */
static int lexi__range_sum(lexi__work *x) {
    return lexi__crc(0, x->range->bytes, x->range->length) == x->range->crc ||
           lexi__range_refuse(x, "its CRC-32 is wrong");
}

/* Decode a range: checks 14 to 18. */
static int lexi__decode_range(lexi__work *x, const lexi_range *range, int verify) {
    uint32_t n = x->chunk->count, lanes = (uint32_t)lexi__clamp((int32_t)(n / 1024), 1, 16), gaussian = 0;
    uint32_t width = range->length < 1 << 17 ? 2 : 4, numbers = (lanes - 1) * width;
    const unsigned char *words = range->bytes;
    uint64_t left;
    x->range = range;
    if (!lexi__range_sum(x)) return 0;
    if (range->length % 2 || range->length < numbers)
        return lexi__range_fail(x, "% bytes are no whole words", range->length, 0);
    left = (range->length - numbers) / 2;
    words += numbers;
    if (left > 1 << 30) return lexi__range_fail(x, "it has % words, at most 2^30 are allowed", left, 0);
    for (uint32_t i = 0; i < lanes; i++) {
        lexi__lane lane;
        uint32_t count = n / lanes + (i < n % lanes), block;
        uint64_t own = i == lanes - 1 ? left
                       : width == 2   ? lexi__u16(range->bytes + 2 * i)
                                      : lexi__u32(range->bytes + 4 * i);
        if (own > left) return lexi__range_fail(x, "lane % has more words than are there", i, 0);
        memset(&lane, 0, sizeof lane);
        if (!lexi__start(&lane.c, words, (size_t)own))
            return lexi__range_fail(x, "lane % has no first state of at least 2^16", i, 0);
        words += 2 * own;
        left -= own;
        for (; count; count -= block, gaussian += block) {
            lexi__gaussian *g = x->g + gaussian;
            int ok = 1;
            block = count < 64 ? count : 64;
            if (range->what == LEXI_PART) ok = lexi__part(x, &lane, g, block);
            else for (uint32_t k = 0; ok && k < block; k++)
                if (range->what == LEXI_BASE) ok = lexi__base(x, &lane, g + k);
                else if (range->what == LEXI_FINER) ok = lexi__finer(x, &lane, g + k);
                else lexi__interim(x, &lane, g + k);
            if (!ok) return 0;
            if (x->no_table) return lexi__range_fail(x, "lane % uses a set that has no tables", i, 0);
            if (lane.c.next > lane.c.words) return lexi__range_fail(x, "lane % goes beyond its words", i, 0);
        }
        if (!lexi__ended(&lane.c))
            return lexi__range_fail(x, "lane % does not end with its words and the state 2^16", i, 0);
    }
    if (verify && lexi__integers_crc(x) != range->integers_crc)
        return lexi__range_refuse(x, "its integers are not those of the index");
    return 1;
}

/* ---- Values ---- */

/* Chunks of the next layer are `begin` to `end` - 1. Whether the one that is responsible for a cell has no base yet. */
static int lexi__is_interim(const lexi_file *f, size_t begin, size_t end, uint64_t z) {
    while (end - begin > 1) { /* the last whose cell is not above z, else the first */
        size_t middle = begin + (end - begin) / 2;
        if (f->chunks[middle].cell <= z) begin = middle;
        else end = middle;
    }
    return end > begin && !f->chunks[begin].range[0].bytes;
}

/* Everything but SH-rest. The base colour is not yet less what SH-rest shows on average. */
static int lexi__evaluate(lexi__work *x, const lexi__gaussian *g, int lack, int interim, double *dc, float *position,
                          float *opacity, float *scale, float *rotation) {
    const double pi = 3.14159265358979323846;
    const lexi__head *h = &x->f->head;
    int32_t values[7], H = lack == 2 ? 9 : lack == 1 ? 3 : 1;
    double part[3], moves[3];
    for (int t = 0; t < 7; t++) {
        int32_t count = t < 4 ? g->count[t] : lexi__multiply(H, g->count[t]);
        values[t] = lexi__add(g->predicted[t], lexi__multiply(count, lexi__step(h, t, t < 4 ? g->shape : g->colour)));
        if (interim)
            values[t] = lexi__add(values[t],
                                  lexi__multiply(g->change[t < 3 ? 0 : t - 2], (int32_t)h->interim_step[t < 3    ? 0
                                                                                                        : t == 3 ? 1
                                                                                                                 : 2]));
        if (values[t] < -(1 << 27) || values[t] >= 1 << 27)
            return lexi__range_fail(x, "target % of a Gaussian is %, not within 2^27", t, values[t]);
    }
    for (int k = 0; k < 3; k++) scale[k] = (float)(values[k] / 1048576.0);
    double o = lexi__min(values[3], -105) / 1048576.0;
    *opacity = (float)(o - log(-expm1(o)));
    for (int k = 0; k < 3; k++) part[k] = (g->rotation[k] + 0.5) / (1u << (g->full[k] - lexi__drop(g->full[k], lack)));
    double i = part[0], j = part[1], half = pi * part[2] / 2,
           u[3] = {i + j - 1, i - j, 1 - fabs(i + j - 1) - fabs(i - j)};
    if (u[2] < 0) u[2] = 0;
    double length = sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]);
    for (int k = 0; k < 3; k++) u[k] /= length;
    double first[3] = {1 - u[0] * u[0] / (1 + u[2]), -u[0] * u[1] / (1 + u[2]), -u[0]};
    double second[3] = {-u[0] * u[1] / (1 + u[2]), 1 - u[1] * u[1] / (1 + u[2]), -u[1]};
    double cosine = cos(2 * half), sine = sin(2 * half), c = cos(half), s = sin(half), r = 1 / sqrt(2 + 2 * u[2]),
           axes[3][3];
    for (int k = 0; k < 3; k++) {
        double v = cosine * first[k] + sine * second[k], w = cosine * second[k] - sine * first[k];
        axes[0][k] = g->needle ? u[k] : v;
        axes[1][k] = g->needle ? v : w;
        axes[2][k] = g->needle ? w : u[k];
    }
    double W = (1 + u[2]) * r * c, X = (u[0] * s - u[1] * c) * r, Y = (u[0] * c + u[1] * s) * r, Z = (1 + u[2]) * r * s;
    rotation[0] = (float)(g->needle ? (W + X + Y + Z) / 2 : W);
    rotation[1] = (float)(g->needle ? (X - W - Y + Z) / 2 : X);
    rotation[2] = (float)(g->needle ? (Y - W - Z + X) / 2 : Y);
    rotation[3] = (float)(g->needle ? (Z - W - X + Y) / 2 : Z);
    for (int k = 0; k < 3; k++) moves[k] = lexi__multiply(H, g->count[7 + k]) * exp2(g->move_log[k] / 512.0);
    for (int n = 0; n < 3; n++) {
        double coordinate = h->origin[n] + (g->cell[n] + 0.5) * h->side;
        dc[n] = h->dc_mean[n];
        for (int k = 0; k < 3; k++) {
            coordinate += moves[k] * axes[k][n];
            dc[n] += values[4 + k] * h->dc_unit * h->dc_axes[k][n];
        }
        position[n] = lexi__round(coordinate);
        if (!lexi__finite(position[n])) return lexi__range_refuse(x, "a position is not finite");
    }
    return 1;
}

/* Averages over the points of view of the SH basis, in units of the first basis function. */
static void lexi__weigh(const lexi_file *f, const float *position, double *weight) {
    const lexi__head *h = &f->head;
    double most = ldexp(1, 60), D[3];
    int n = f->info.d / 3;
    for (int i = 0; i < n; i++) weight[i] = 0;
    for (int p = 0; p < h->points; p++) {
        for (int k = 0; k < 3; k++) {
            D[k] = (double)position[k] - h->point[p][k];
            D[k] = D[k] < -most ? -most : D[k] > most ? most : D[k];
        }
        double length = sqrt(D[0] * D[0] + D[1] * D[1] + D[2] * D[2] + (double)h->softening * h->softening);
        double x = D[0] / length, y = D[1] / length, z = D[2] / length, xx = x * x, yy = y * y, zz = z * z;
        double xy = x * y, yz = y * z, xz = x * z;
        double b[24] = {
            -0.48860251 * y, 0.48860251 * z, -0.48860251 * x,
            1.0925484 * xy, -1.0925484 * yz, 0.31539157 * (2 * zz - xx - yy), -1.0925484 * xz, 0.5462742 * (xx - yy),
            -0.5900436 * y * (3 * xx - yy), 2.8906114 * xy * z, -0.4570458 * y * (4 * zz - xx - yy),
            0.37317634 * z * (2 * zz - 3 * xx - 3 * yy), -0.4570458 * x * (4 * zz - xx - yy), 1.4453057 * z * (xx - yy),
            -0.5900436 * x * (xx - 3 * yy),
            2.5033429 * xy * (xx - yy), -1.7701308 * yz * (3 * xx - yy), 0.9461747 * xy * (7 * zz - 1),
            -0.6690465 * yz * (7 * zz - 3), 0.10578555 * (zz * (35 * zz - 30) + 3), -0.6690465 * xz * (7 * zz - 3),
            0.47308734 * (xx - yy) * (7 * zz - 1), -1.7701308 * xz * (xx - 3 * yy),
            0.6258357 * (xx * (xx - 3 * yy) - yy * (3 * xx - yy))};
        for (int i = 0; i < n; i++) weight[i] += b[i] / (0.28209479 * h->points);
    }
}

/* Add value times atom to SH-rest. */
static void lexi__add_atom(float *sh_rest, const float *atom, float value, int d) {
    for (int k = 0; k < d; k++) {
        float product = value * atom[k];
        sh_rest[k] += product;
    }
}

/* ---- Scenes ---- */

static int lexi__new_scene(lexi__call *call, const lexi_file *f, uint64_t n, int sh_rest, lexi_scene *s) {
    uint64_t d = (uint64_t)f->info.d;
    s->d = (int)d;
    s->count = (size_t)n;
    if (!lexi__resize(call, &s->number, 0, n, 4) || !lexi__resize(call, &s->position, 0, 3 * n, 4) ||
        !lexi__resize(call, &s->dc, 0, 3 * n, 4) || !lexi__resize(call, &s->opacity, 0, n, 4) ||
        !lexi__resize(call, &s->scale, 0, 3 * n, 4) || !lexi__resize(call, &s->rotation, 0, 4 * n, 4)) return 0;
    if ((sh_rest & LEXI_DENSE) && !lexi__resize(call, &s->sh_rest, 0, n * d, 4)) return 0;
    return !(sh_rest & LEXI_SPARSE) ||
           (lexi__resize(call, &s->code_first, 0, n, sizeof(size_t)) && lexi__resize(call, &s->code_count, 0, n, 1));
}

void lexi_free_scene(lexi_scene *s) {
    LEXI_FREE(s->number); LEXI_FREE(s->position); LEXI_FREE(s->dc); LEXI_FREE(s->opacity); LEXI_FREE(s->scale);
    LEXI_FREE(s->rotation); LEXI_FREE(s->normal); LEXI_FREE(s->sh_rest); LEXI_FREE(s->code_first);
    LEXI_FREE(s->code_count); LEXI_FREE(s->atom); LEXI_FREE(s->value); LEXI_FREE(s->exact_rows);
    memset(s, 0, sizeof *s);
}

/* Append the codes of Gaussian `at`: n nonzeros, or a row that is not NULL. */
static int lexi__add_codes(lexi__call *call, lexi_scene *s, size_t at, int n, const uint16_t *atoms,
                           const float *values, const float *row) {
    size_t room = s->code_room, d = (size_t)s->d, count = (size_t)n;
    s->code_count[at] = (uint8_t)(row ? LEXI_EXACT : n);
    s->code_first[at] = row ? s->exact_total : s->code_total;
    if (row) {
        if (!lexi__grow(call, &s->exact_rows, &s->exact_room, s->exact_total * d, d, sizeof *row)) return 0;
        memcpy(s->exact_rows + s->exact_total++ * d, row, d * sizeof *row);
        return 1;
    }
    if (!lexi__grow(call, &s->atom, &room, s->code_total, count, sizeof *atoms) ||
        !lexi__grow(call, &s->value, &s->code_room, s->code_total, count, sizeof *values)) return 0;
    memcpy(s->atom + s->code_total, atoms, count * sizeof *atoms);
    memcpy(s->value + s->code_total, values, count * sizeof *values);
    s->code_total += count;
    return 1;
}

/* Decode the ranges of a packed chunk that count. `verified` counts them if integers are to be verified, else NULL. */
static int lexi__decode_ranges(lexi__work *x, int with_interim, int *lack, int *parts, size_t *verified) {
    const lexi_chunk *chunk = x->chunk;
    int follows[4] = {1, 1, 1, 1}, verify = verified != NULL;
    *lack = chunk->finer;
    *parts = 0;
    follows[LEXI_INTERIM] = with_interim;
    for (int i = 0; i < chunk->range_count; i++) {
        const lexi_range *range = &chunk->range[i];
        if (!range->bytes) follows[range->what] = 0;
        if (range->what == LEXI_INTERIM && range->bytes && !with_interim) { /* not needed, but damage is still seen */
            x->range = range;
            if (!lexi__range_sum(x)) return 0;
        }
        if (!follows[range->what]) continue;
        if (!lexi__decode_range(x, range, verify)) return 0;
        if (range->what == LEXI_FINER) --*lack;
        if (range->what == LEXI_PART) ++*parts;
        if (verify) ++*verified;
    }
    return 1;
}

/* SH-rest of Gaussian g as decoded so far, and its codes if they are wanted. */
static int lexi__packed_sh(lexi__work *x, const lexi__gaussian *g, int parts, size_t *used, size_t *row, lexi_scene *s,
                           size_t at, float *sh_rest) {
    const lexi_file *f = x->f;
    int d = f->info.d, n = 0;
    uint16_t atoms[72];
    float values[72], step = lexi__round(ldexp(f->head.value_step, f->head.promised ? 0 : g->colour));
    memset(sh_rest, 0, (size_t)d * sizeof *sh_rest);
    if (g->exact) {
        for (int k = 0; k < d; k++) sh_rest[k] = lexi__float(x->rows[*row + (size_t)k]);
        *row += (size_t)d;
    }
    for (int p = 0; p < parts && !g->exact; p++)
        for (int k = 0; k < g->nonzeros[p]; k++, used[p]++) {
            int slot = n++;
            uint16_t atom = x->atoms[p][used[p]];
            float product = (float)x->sizes[p][used[p]] * step;
            for (; slot > 0 && atoms[slot - 1] >= atom; slot--) {
                if (atoms[slot - 1] == atom) return lexi__range_fail(x, "a Gaussian has atom % twice", atom, 0);
                atoms[slot] = atoms[slot - 1];
                values[slot] = values[slot - 1];
            }
            atoms[slot] = atom;
            values[slot] = lexi__to_half(product);
            if (!lexi__finite(values[slot])) return lexi__range_refuse(x, "an SH value is not finite in f16");
        }
    for (int k = 0; k < n; k++) lexi__add_atom(sh_rest, f->dictionary + (size_t)atoms[k] * (size_t)d, values[k], d);
    for (int k = 0; k < d; k++)
        if (!lexi__finite(sh_rest[k])) return lexi__range_refuse(x, "SH-rest of a Gaussian is not finite");
    if (s->code_first) return lexi__add_codes(x->call, s, at, n, atoms, values, g->exact ? sh_rest : NULL);
    return 1;
}

static int lexi__packed_into(lexi__call *call, const lexi_file *f, size_t index, lexi_scene *s, size_t at,
                             size_t *verified) {
    lexi__work x;
    size_t begin = index, end, used[3] = {0}, row = 0;
    int lack = 0, parts = 0, missing = 0, ok;
    memset(&x, 0, sizeof x);
    x.call = call;
    x.f = f;
    x.chunk = &f->chunks[index];
    x.index = index;
    /* The chunks of the next layer, and whether one of them has no base yet. */
    while (begin < f->info.chunk_count && f->chunks[begin].layer == x.chunk->layer) begin++;
    for (end = begin; end < f->info.chunk_count && f->chunks[end].layer == x.chunk->layer + 1; end++)
        if (!f->chunks[end].range[0].bytes) missing = 1;
    ok = lexi__resize(call, &x.g, 0, x.chunk->count, sizeof *x.g) &&
         lexi__decode_ranges(&x, missing || verified, &lack, &parts, verified);
    x.range = &x.chunk->range[0];
    missing = missing && x.chunk->range[x.chunk->range_count - 1].what == LEXI_INTERIM &&
              x.chunk->range[x.chunk->range_count - 1].bytes;
    for (uint32_t i = 0; ok && s && i < x.chunk->count; i++, at++) {
        const lexi__gaussian *g = &x.g[i];
        float sh_rest[72], *position = s->position + 3 * at;
        double dc[3], weight[24];
        s->number[at] = (uint32_t)(x.chunk->first + i);
        ok = lexi__evaluate(&x, g, lack, missing && lexi__is_interim(f, begin, end, g->z), dc, position,
                            s->opacity + at, s->scale + 3 * at, s->rotation + 4 * at) &&
             lexi__packed_sh(&x, g, parts, used, &row, s, at, sh_rest);
        if (!ok) break;
        if (f->head.points) lexi__weigh(f, position, weight);
        for (int n = 0; n < 3; n++) {
            for (int k = 0; f->head.points && k < s->d / 3; k++) dc[n] -= weight[k] * sh_rest[n * (s->d / 3) + k];
            s->dc[3 * at + (size_t)n] = lexi__round(dc[n]);
            if (!lexi__finite(s->dc[3 * at + (size_t)n])) {
                ok = lexi__range_refuse(&x, "a base colour is not finite");
                break;
            }
        }
        if (s->sh_rest) memcpy(s->sh_rest + at * (size_t)s->d, sh_rest, (size_t)s->d * sizeof *sh_rest);
    }
    LEXI_FREE(x.g);
    for (int p = 0; p < 3; p++) { LEXI_FREE(x.atoms[p]); LEXI_FREE(x.sizes[p]); }
    LEXI_FREE(x.rows);
    return ok;
}

/* Layouts f32, f16 and paper: checks 6 and 7 of values and indices. */
static int lexi__plain_into(lexi__call *call, lexi_file *f, const lexi_chunk *chunk, lexi_scene *s, size_t at) {
    static const char *const names[6] = {"position", "dc", "opacity", "scale", "rotation", "normal"};
    static const size_t widths[6] = {3, 3, 1, 3, 4, 3};
    float *arrays[6] = {s->position, s->dc, s->opacity, s->scale, s->rotation, s->normal};
    int d = f->info.d, paper = lexi__is(f->layout, "paper"), f16 = lexi__is(f->layout, "f16");
    uint64_t k = chunk->first_code, exact = chunk->first_exact;
    for (int a = 0; a < 6; a++) {
        lexi__tensor *t = lexi__find(f, names[a]);
        for (size_t i = 0; t && i < widths[a] * chunk->count; i++) {
            float x = arrays[a][widths[a] * at + i] = lexi__float_at(lexi__data(f, t), widths[a] * chunk->first + i);
            if (!lexi__finite(x))
                return lexi__named(call, "tensor ", names[a], strlen(names[a]), "a value is not finite");
        }
    }
    for (uint32_t i = 0; i < chunk->count; i++) s->number[at + i] = (uint32_t)(chunk->first + i);
    if (!d) {
        for (uint32_t i = 0; s->code_count && i < chunk->count; i++) s->code_first[at + i] = s->code_total;
        return 1;
    }
    lexi__tensor *escapes = lexi__find(f, "escapes.gaussians"), *rows = lexi__find(f, "escapes.rows");
    const unsigned char *counts = lexi__data(f, lexi__find(f, paper ? "codes.pointers" : "codes.counts"));
    const unsigned char *indices = lexi__data(f, lexi__find(f, "codes.indices")),
                        *all = lexi__data(f, lexi__find(f, "codes.values"));
    for (uint64_t i = chunk->first; i < chunk->first + chunk->count; i++, at++) {
        float sh_rest[72] = {0}, values[72];
        uint16_t atoms[72];
        int n = (int)lexi__plain_count(f, counts, i),
            is_exact = escapes && exact < escapes->shape[0] && lexi__u32(lexi__data(f, escapes) + 4 * exact) == i;
        for (int j = 0; j < n; j++, k++) {
            uint32_t atom = paper             ? lexi__u32(indices + 4 * k)
                            : f->info.m > 256 ? lexi__u16(indices + 2 * k)
                                              : indices[k];
            if (atom >= (uint32_t)f->info.m)
                return lexi__damaged(call, "tensor codes.indices", "entry % is %, not below m", k, atom);
            if (j && atom <= atoms[j - 1])
                return lexi__damaged(call, "tensor codes.indices", "entry % is %, not ascending", k, atom);
            atoms[j] = (uint16_t)atom;
            values[j] = f16 ? lexi__half(lexi__u16(all + 2 * k)) : lexi__float_at(all, k);
            if (!lexi__finite(values[j]))
                return lexi__damaged(call, "tensor codes.values", "entry % is not finite", k, 0);
            lexi__add_atom(sh_rest, f->dictionary + (size_t)atom * (size_t)d, values[j], d);
        }
        if (is_exact)
            for (int j = 0; j < d; j++)
                sh_rest[j] = lexi__float_at(lexi__data(f, rows), exact * (uint64_t)d + (uint64_t)j);
        for (int j = 0; j < d; j++)
            if (!lexi__finite(sh_rest[j]))
                return lexi__damaged(call, is_exact ? "tensor escapes.rows" : "tensor codes.values",
                                     "SH-rest of Gaussian % is not finite", i, 0);
        if (s->code_first && !lexi__add_codes(call, s, at, n, atoms, values, is_exact ? sh_rest : NULL)) return 0;
        if (s->sh_rest) memcpy(s->sh_rest + at * (size_t)d, sh_rest, (size_t)d * sizeof *sh_rest);
        exact += (uint64_t)is_exact;
    }
    return 1;
}

static int lexi__decode_some(lexi_file *f, size_t begin, size_t end, int sh_rest, lexi_scene *s, lexi_error *error) {
    lexi__call call = lexi__begin_call(f, error);
    uint64_t n = 0, at = 0;
    size_t i;
    int ok;
    memset(s, 0, sizeof *s);
    if (f->info.dictionary_only) return lexi__misuse(&call, "metadata format", "a dictionary alone has no Gaussians");
    for (i = begin; i < end; i++) if (!f->info.packed || f->chunks[i].range[0].bytes) n += f->chunks[i].count;
    ok = lexi__new_scene(&call, f, n, sh_rest, s);
    if (ok && lexi__find(f, "normal")) ok = lexi__resize(&call, &s->normal, 0, 3 * n, sizeof(float));
    for (i = begin; ok && i < end; i++) {
        uint64_t left = call.left;
        if (f->info.packed && !f->chunks[i].range[0].bytes) continue;
        ok = f->info.packed ? lexi__packed_into(&call, f, i, s, (size_t)at, NULL)
                            : lexi__plain_into(&call, f, &f->chunks[i], s, (size_t)at);
        at += f->chunks[i].count;
        call.left = s->code_first ? call.left : left; /* what the chunk alone took is free again */
    }
    if (!ok) lexi_free_scene(s);
    return ok;
}

int lexi_decode(lexi_file *f, int sh_rest, lexi_scene *scene, lexi_error *error) {
    return lexi__decode_some(f, 0, f->info.chunk_count, sh_rest, scene, error);
}

int lexi_decode_chunk(lexi_file *f, size_t chunk, int sh_rest, lexi_scene *scene, lexi_error *error) {
    lexi__call call = lexi__begin_call(f, error);
    if (chunk >= f->info.chunk_count) return lexi__misuse(&call, "chunk", "there is no such chunk");
    return lexi__decode_some(f, chunk, chunk + 1, sh_rest, scene, error);
}

int lexi_verify_integers(lexi_file *f, size_t *ranges, lexi_error *error) {
    *ranges = 0;
    for (size_t i = 0; f->info.packed && i < f->info.chunk_count; i++) {
        lexi__call call = lexi__begin_call(f, error);
        if (f->chunks[i].range[0].bytes && !lexi__packed_into(&call, f, i, NULL, 0, ranges)) return 0;
    }
    return 1;
}

/* ---- Coded columns ---- */

typedef struct { const unsigned char *in; size_t n, at; uint32_t bits; int count, bad; } lexi__deflate;
typedef struct { uint16_t count[16], symbol[288]; } lexi__code; /* symbols of each length, in order */

static uint32_t lexi__take_bits(lexi__deflate *z, int n) {
    while (z->count < n) {
        if (z->at == z->n) { z->bad = 1; return 0; }
        z->bits |= (uint32_t)z->in[z->at++] << z->count;
        z->count += 8;
    }
    uint32_t bits = z->bits & ((1u << n) - 1);
    z->bits >>= n;
    z->count -= n;
    return bits;
}

/* A code is complete, or has one symbol of one bit, or none. */
static int lexi__make_code(lexi__code *code, const uint8_t *lengths, int n) {
    int left = 1, total = 0, at[16];
    memset(code->count, 0, sizeof code->count);
    for (int i = 0; i < n; i++) code->count[lengths[i]]++;
    code->count[0] = 0;
    at[0] = at[1] = 0;
    for (int k = 1; k < 16; k++) {
        left = 2 * left - code->count[k];
        if (left < 0) return 0;
        total += code->count[k];
        if (k < 15) at[k + 1] = at[k] + code->count[k];
    }
    for (int i = 0; i < n; i++) if (lengths[i]) code->symbol[at[lengths[i]]++] = (uint16_t)i;
    return left == 0 || total == 0 || (total == 1 && code->count[1] == 1);
}

static int lexi__code_symbol(lexi__deflate *z, const lexi__code *code) {
    int value = 0, first = 0, index = 0;
    for (int k = 1; k < 16; k++) {
        value |= (int)lexi__take_bits(z, 1);
        if (value - first < code->count[k]) return z->bad ? 0 : code->symbol[index + value - first];
        index += code->count[k];
        first = (first + code->count[k]) << 1;
        value <<= 1;
    }
    z->bad = 1;
    return 0;
}

static int lexi__read_codes(lexi__deflate *z, lexi__code *literals, lexi__code *distances) {
    static const uint8_t order[19] = {16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15};
    uint8_t lengths[320] = {0};
    int n = (int)lexi__take_bits(z, 5) + 257, m = (int)lexi__take_bits(z, 5) + 1, k = (int)lexi__take_bits(z, 4) + 4,
        i = 0;
    if (n > 286 || m > 30) return 0;
    while (i < k) lengths[order[i++]] = (uint8_t)lexi__take_bits(z, 3);
    if (!lexi__make_code(literals, lengths, 19)) return 0;
    memset(lengths, 0, sizeof lengths);
    for (i = 0; i < n + m && !z->bad;) {
        int symbol = lexi__code_symbol(z, literals), repeat = 1;
        uint8_t length = (uint8_t)(symbol < 16 ? symbol : 0);
        if (symbol == 16) {
            if (!i) return 0;
            length = lengths[i - 1];
        }
        if (symbol > 15)
            repeat = symbol == 16   ? 3 + (int)lexi__take_bits(z, 2)
                     : symbol == 17 ? 3 + (int)lexi__take_bits(z, 3)
                                    : 11 + (int)lexi__take_bits(z, 7);
        if (i + repeat > n + m) return 0;
        while (repeat--) lengths[i++] = length;
    }
    return !z->bad && lengths[256] && lexi__make_code(literals, lengths, n) &&
           lexi__make_code(distances, lengths + n, m);
}

/* Decode raw deflate data of n bytes (RFC 1951) to exactly `room` bytes. */
static int lexi__inflate(const unsigned char *in, size_t n, unsigned char *out, size_t room) {
    static const uint16_t lengths[29] = {3,  4,  5,  6,  7,  8,  9,  10, 11,  13,  15,  17,  19,  23, 27,
                                         31, 35, 43, 51, 59, 67, 83, 99, 115, 131, 163, 195, 227, 258};
    static const uint16_t distances[30] = {1,    2,    3,    4,    5,    7,    9,    13,    17,    25,
                                           33,   49,   65,   97,   129,  193,  257,  385,   513,   769,
                                           1025, 1537, 2049, 3073, 4097, 6145, 8193, 12289, 16385, 24577};
    lexi__deflate z = {in, n, 0, 0, 0, 0};
    lexi__code literal, distance;
    uint8_t fixed[288];
    size_t at = 0;
    int last = 0;
    while (!last) {
        last = (int)lexi__take_bits(&z, 1);
        int type = (int)lexi__take_bits(&z, 2);
        if (z.bad || type == 3) return 0;
        if (type == 0) {
            size_t length;
            z.bits = 0;
            z.count = 0; /* fewer than 8 bits are left, since bytes are taken one by one */
            if (n - z.at < 4 || (lexi__u16(in + z.at) ^ lexi__u16(in + z.at + 2)) != 0xffff) return 0;
            length = lexi__u16(in + z.at);
            z.at += 4;
            if (length > n - z.at || length > room - at) return 0;
            memcpy(out + at, in + z.at, length);
            at += length;
            z.at += length;
            continue;
        }
        if (type == 1) {
            for (int i = 0; i < 288; i++) fixed[i] = i < 144 ? 8 : i < 256 ? 9 : i < 280 ? 7 : 8;
            lexi__make_code(&literal, fixed, 288);
            memset(fixed, 5, 30);
            lexi__make_code(&distance, fixed, 30);
        } else if (!lexi__read_codes(&z, &literal, &distance)) return 0;
        for (;;) {
            int symbol = lexi__code_symbol(&z, &literal);
            if (z.bad || symbol > 285) return 0;
            if (symbol == 256) break;
            if (symbol < 256) {
                if (at == room) return 0;
                out[at++] = (unsigned char)symbol;
                continue;
            }
            symbol -= 257;
            size_t length = lengths[symbol] + (symbol < 8 || symbol == 28 ? 0 : lexi__take_bits(&z, (symbol - 4) / 4)),
                   back;
            symbol = lexi__code_symbol(&z, &distance);
            if (z.bad || symbol > 29) return 0;
            back = distances[symbol] + (symbol < 4 ? 0 : lexi__take_bits(&z, (symbol - 2) / 2));
            if (z.bad || back > at || length > room - at) return 0;
            for (; length; length--, at++) out[at] = out[at - back];
        }
    }
    return at == room && z.at == n;
}

static int lexi__stream(lexi__cursor *c, unsigned char *out, size_t n) {
    size_t length = lexi__fixed(c, "a stream", 4);
    const unsigned char *in = lexi__bytes(c, "a stream", length);
    if (in && !lexi__inflate(in, length, out, n))
        lexi__bad(c, "a stream", "does not decode to exactly the bytes that it should hold");
    return !c->why;
}

/* numbers(n, w), as little-endian bytes. `planes` has room for n w bytes. */
static int lexi__numbers(lexi__cursor *c, unsigned char *out, unsigned char *planes, size_t n, size_t w) {
    uint32_t filter = lexi__fixed(c, "numbers", 1);
    uint64_t x = 0;
    if (filter == 1) return lexi__stream(c, out, n * w);
    if (filter != 2 && filter != 3) { lexi__bad(c, "numbers", "have an unknown filter"); return 0; }
    for (size_t k = 0; k < w; k++) if (!lexi__stream(c, planes + k * n, n)) return 0;
    for (size_t i = 0; i < n; i++) {
        uint64_t z = 0;
        for (size_t k = 0; k < w; k++) z |= (uint64_t)planes[k * n + i] << (8 * k);
        x = filter == 2 ? z : x + (z >> 1 ^ (0 - (z & 1)));
        for (size_t k = 0; k < w; k++) out[i * w + k] = (unsigned char)(x >> (8 * k));
    }
    return 1;
}

static int lexi__block(lexi__cursor *c, unsigned char *out, unsigned char *planes, unsigned char *palette,
                       unsigned char *indices, size_t n, size_t w) {
    uint32_t filter = c->p < c->end ? c->p[0] : 255;
    if (filter && filter != 4) return lexi__numbers(c, out, planes, n, w);
    c->p++;
    if (!filter) {
        const unsigned char *value = lexi__bytes(c, "a block", w);
        for (size_t i = 0; value && i < n; i++) memcpy(out + i * w, value, w);
        return value != NULL;
    }
    size_t colours = lexi__fixed(c, "a palette", 2) + 1, size = colours <= 256 ? 1 : 2;
    if (colours > n) lexi__bad(c, "a palette", "has more values than the block has rows");
    if (c->why || !lexi__numbers(c, palette, planes, colours, w) || !lexi__numbers(c, indices, planes, n, size))
        return 0;
    for (size_t i = 0; i < n; i++) {
        size_t index = size == 1 ? indices[i] : lexi__u16(indices + 2 * i);
        if (index >= colours) { lexi__bad(c, "a palette", "has no value for a row"); return 0; }
        memcpy(out + i * w, palette + index * w, w);
    }
    return 1;
}

/* Decode a coded column of N values: check 13. */
static int lexi__column(lexi__call *call, const lexi_file *f, const lexi__tensor *t, int *type, int *width,
                        unsigned char **values) {
    lexi__cursor c = {lexi__data(f, t), lexi__data(f, t) + (size_t)(t->end - t->begin), NULL, NULL};
    size_t n = (size_t)f->info.gaussians, block = n < 65536 ? n : 65536, w = lexi__column_width(f, t),
           wide = w < 2 ? 2 : w;
    unsigned char *buffers = NULL;
    int ok;
    *type = (int)lexi__fixed(&c, "its type", 1);
    if (!w) return lexi__named(call, "tensor ", t->name.s, t->name.n, "the type of its values is unknown");
    *width = (int)w;
    ok =
        lexi__resize(call, values, 0, (uint64_t)n * w, 1) && lexi__resize(call, &buffers, 0, block * (wide + w + 2), 1);
    for (size_t at = 0; ok && at < n; at += block) {
        size_t rows = n - at < block ? n - at : block, length = lexi__fixed(&c, "a block", 4);
        const unsigned char *body = lexi__bytes(&c, "a block", length);
        if (!body) break;
        lexi__cursor inner = {body, body + length, NULL, NULL};
        if (lexi__block(&inner, *values + at * w, buffers, buffers + block * wide, buffers + block * (wide + w), rows,
                        w) &&
            inner.p != inner.end)
            lexi__bad(&inner, "a block", "has bytes after what it describes");
        if (inner.why) lexi__bad(&c, inner.field, inner.why);
    }
    if (ok && !c.why && c.p != c.end) lexi__bad(&c, "the column", "goes on after its last block");
    LEXI_FREE(buffers);
    if (ok && c.why) {
        char name[80];
        size_t length = lexi__put(name, 0, sizeof name, t->name.s, t->name.n);
        length = lexi__put(name, length, sizeof name, ", ", 2);
        length = lexi__put(name, length, sizeof name, c.field, strlen(c.field));
        ok = lexi__named(call, "tensor ", name, length, c.why);
    }
    if (!ok) { LEXI_FREE(*values); *values = NULL; }
    return ok;
}

int lexi_decode_extra(lexi_file *f, size_t index, lexi_extra *extra, lexi_error *error) {
    lexi__call call = lexi__begin_call(f, error);
    memset(extra, 0, sizeof *extra);
    if (index >= f->info.extra_count) return lexi__misuse(&call, "extra", "there is no such property");
    const lexi__tensor *t = &f->tensors[f->extras[index]];
    extra->name = t->name.s + 6;
    extra->name_length = t->name.n - 6;
    if (f->size < f->whole) return 1;
    if (f->info.packed) return lexi__column(&call, f, t, &extra->type, &extra->width, &extra->values);
    extra->type = t->type;
    extra->width = (int)lexi__type_bytes[t->type];
    if (!lexi__resize(&call, &extra->values, 0, t->end - t->begin, 1)) return 0;
    memcpy(extra->values, lexi__data(f, t), (size_t)(t->end - t->begin));
    return 1;
}

void lexi_free_extra(lexi_extra *extra) {
    LEXI_FREE(extra->values);
    memset(extra, 0, sizeof *extra);
}

/* Move row k of n to index order[k]. */
static int lexi__move_rows(lexi__call *call, void *pointer, const uint32_t *order, size_t n, size_t width) {
    unsigned char *moved = NULL, *rows;
    uint64_t left = call->left;
    memcpy(&rows, pointer, sizeof rows);
    if (!rows) return 1;
    if (!lexi__resize(call, &moved, 0, n, width)) return 0;
    for (size_t k = 0; k < n; k++) memcpy(moved + order[k] * width, rows + k * width, width);
    LEXI_FREE(rows);
    memcpy(pointer, &moved, sizeof moved);
    call->left = left;
    return 1;
}

int lexi_restore_order(lexi_file *f, lexi_scene *s, lexi_extra *extras, size_t extra_count, lexi_error *error) {
    lexi__call call = lexi__begin_call(f, error);
    lexi__tensor *t = f->info.packed ? lexi__find(f, "packed.order") : NULL;
    size_t n = s->count, d = (size_t)s->d * sizeof(float);
    unsigned char *values = NULL, *seen = NULL;
    uint32_t *order = NULL;
    int type, width, ok = 1;
    if (!t || f->size < f->whole) return 1;
    if (n != f->info.gaussians) return lexi__misuse(&call, "scene", "it has not all Gaussians of the file");
    if (!lexi__column(&call, f, t, &type, &width, &values)) return 0;
    if (type != LEXI__U32)
        ok = lexi__damaged(&call, "tensor packed.order", "its type is %, only 5 (U32) is allowed", type, 0);
    ok = ok && lexi__resize(&call, &seen, 0, n, 1) && lexi__resize(&call, &order, 0, n, sizeof *order);
    for (size_t k = 0; ok && k < n; k++) {
        order[k] = lexi__u32(values + 4 * k);
        if (order[k] >= n || seen[order[k]]++)
            ok = lexi__damaged(&call, "tensor packed.order", "entry % is %, no permutation has this", k, order[k]);
    }
    ok = ok && lexi__move_rows(&call, &s->number, order, n, 4) && lexi__move_rows(&call, &s->position, order, n, 12) &&
         lexi__move_rows(&call, &s->dc, order, n, 12) && lexi__move_rows(&call, &s->opacity, order, n, 4) &&
         lexi__move_rows(&call, &s->scale, order, n, 12) && lexi__move_rows(&call, &s->rotation, order, n, 16) &&
         lexi__move_rows(&call, &s->sh_rest, order, n, d) &&
         lexi__move_rows(&call, &s->code_first, order, n, sizeof(size_t)) &&
         lexi__move_rows(&call, &s->code_count, order, n, 1);
    for (size_t i = 0; ok && i < extra_count; i++)
        ok = lexi__move_rows(&call, &extras[i].values, order, n, (size_t)extras[i].width);
    LEXI_FREE(values);
    LEXI_FREE(seen);
    LEXI_FREE(order);
    return ok;
}

#if !defined(__clang__) && defined(__GNUC__)
#pragma GCC pop_options
#endif
#endif /* LEXI_IMPLEMENTATION */
