/* All of the C library that core uses, for chips that have none: memory.c. A compiler may call these without being asked. */
#ifndef CORTEX_M_STRING_H
#define CORTEX_M_STRING_H

#include <stddef.h>

void *memcpy(void *restrict to, const void *restrict from, size_t size);
void *memset(void *to, int value, size_t size);
int memcmp(const void *left, const void *right, size_t size);

#endif
