/* memcpy, memset and memcmp: the three that a compiler may call without being asked. */
#include <stddef.h>
#include <stdint.h>

void *memcpy(void *restrict to, const void *restrict from, size_t size);
void *memset(void *to, int value, size_t size);
int memcmp(const void *left, const void *right, size_t size);

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
