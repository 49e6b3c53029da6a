/* memcpy, memset and memcmp, by words where both ends are aligned; and clang's other names for them. */
#include "string.h"

#include <stdint.h>

typedef uint32_t __attribute__((may_alias)) word;

void *memcpy(void *restrict to, const void *restrict from, size_t size) {
    uint8_t *out = to;
    const uint8_t *in = from;
    if ((((uintptr_t)out | (uintptr_t)in) & 3u) == 0u) {
        for (; size >= 4u; size -= 4u, out += 4, in += 4) *(word *)(void *)out = *(const word *)(const void *)in;
    }
    while (size--) *out++ = *in++;
    return to;
}

void *memset(void *to, int value, size_t size) {
    uint8_t *out = to;
    const uint32_t fill = (uint8_t)value * 0x01010101u;
    if (((uintptr_t)out & 3u) == 0u) {
        for (; size >= 4u; size -= 4u, out += 4) *(word *)(void *)out = fill;
    }
    while (size--) *out++ = (uint8_t)value;
    return to;
}

int memcmp(const void *left, const void *right, size_t size) {
    const uint8_t *a = left, *b = right;
    for (; size--; a++, b++) {
        if (*a != *b) return *a < *b ? -1 : 1;
    }
    return 0;
}

/* Arm's run-time ABI, IHI 0043; 4 and 8: that alignment is promised. */
#define ALSO(name, type, parameters, ...) \
    type name parameters; \
    type name parameters { __VA_ARGS__; }
ALSO(__aeabi_memcpy, void, (void *to, const void *from, size_t size), memcpy(to, from, size))
ALSO(__aeabi_memcpy4, void, (void *to, const void *from, size_t size), memcpy(to, from, size))
ALSO(__aeabi_memcpy8, void, (void *to, const void *from, size_t size), memcpy(to, from, size))
ALSO(__aeabi_memset, void, (void *to, size_t size, int value), memset(to, value, size))
ALSO(__aeabi_memset4, void, (void *to, size_t size, int value), memset(to, value, size))
ALSO(__aeabi_memset8, void, (void *to, size_t size, int value), memset(to, value, size))
ALSO(__aeabi_memclr, void, (void *to, size_t size), memset(to, 0, size))
ALSO(__aeabi_memclr4, void, (void *to, size_t size), memset(to, 0, size))
ALSO(__aeabi_memclr8, void, (void *to, size_t size), memset(to, 0, size))
