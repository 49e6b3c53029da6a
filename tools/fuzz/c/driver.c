/* The engine where there is no libFuzzer: runs files once, or mutates them for a while. It is blind: no coverage guides it.
 *
 *     driver FILE...                           each once
 *     driver -seconds=N -seed=S -last=PATH FILE...   mutated; PATH always holds the input under way, for who comes after
 *                                              a crash
 */
#define _POSIX_C_SOURCE 200809L
#include <fcntl.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);
#define LONGEST 8192

typedef struct {
    uint8_t *bytes;
    size_t size;
} content;

static uint64_t state = 1;

/* xorshift64*. */
static uint32_t below(uint32_t limit) {
    state ^= state >> 12;
    state ^= state << 25;
    state ^= state >> 27;
    return (uint32_t)((state * UINT64_C(2685821657736338717)) >> 33) % limit;
}

static content read_file(const char *path) {
    content c = {malloc(LONGEST), 0};
    FILE *file = fopen(path, "rb");
    if (file == NULL || c.bytes == NULL) {
        fprintf(stderr, "driver: cannot read %s\n", path);
        exit(2);
    }
    c.size = fread(c.bytes, 1, LONGEST, file);
    fclose(file);
    return c;
}

/* One run on memory of exactly its size. */
static void run(const uint8_t *bytes, size_t size) {
    uint8_t *exact = malloc(size > 0 ? size : 1);
    if (exact != NULL) {
        memcpy(exact, bytes, size);
        LLVMFuzzerTestOneInput(exact, size);
        free(exact);
    }
}

static size_t spliced(uint8_t *bytes, size_t size, const content *other) {
    size_t at = below((uint32_t)size + 1), from = below((uint32_t)other->size + 1), take = other->size - from;
    take = take < LONGEST - at ? take : LONGEST - at;
    memcpy(bytes + at, other->bytes + from, take);
    return at + take;
}

static size_t mutated(uint8_t *bytes, size_t size, const content *other) {
    static const uint8_t telling[] = {0, 1, 2, 4, 7, 8, 0x7F, 0x80, 0x81, 0x83, 0xFE, 0xFF};
    size_t at = below((uint32_t)(size > 0 ? size : 1));
    switch (size > 0 ? below(6) : 5) {
    case 0: bytes[at] ^= (uint8_t)(1u << below(8)); return size;
    case 1: bytes[at] = (uint8_t)below(256); return size;
    case 2: bytes[at] = telling[below(sizeof telling)]; return size;
    case 3: memmove(bytes + at, bytes + at + 1, size - at - 1); return size - 1;
    case 4:
        if (size < LONGEST) {
            memmove(bytes + at + 1, bytes + at, size - at);
            return size + 1;
        }
        return size;
    default: return spliced(bytes, size, other);
    }
}

static uint8_t *shared_file(const char *path) {
    int fd = open(path, O_RDWR | O_CREAT | O_TRUNC, 0600);
    void *memory = MAP_FAILED;
    if (fd >= 0 && ftruncate(fd, LONGEST + 4) == 0) {
        memory = mmap(NULL, LONGEST + 4, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    }
    if (memory == MAP_FAILED) {
        fprintf(stderr, "driver: cannot map %s\n", path);
        exit(2);
    }
    return memory;
}

int main(int argc, char **argv) {
    long seconds = 0, executions = 0;
    const char *last_path = NULL;
    content *seeds = calloc((size_t)argc + 1, sizeof *seeds);
    uint32_t count = 0;
    for (int i = 1; i < argc && seeds != NULL; i++) {
        if (strncmp(argv[i], "-seconds=", 9) == 0) {
            seconds = atol(argv[i] + 9);
        } else if (strncmp(argv[i], "-seed=", 6) == 0) {
            state = 2 * strtoull(argv[i] + 6, NULL, 10) + 1;
        } else if (strncmp(argv[i], "-last=", 6) == 0) {
            last_path = argv[i] + 6;
        } else {
            seeds[count++] = read_file(argv[i]);
        }
    }
    for (uint32_t i = 0; i < count; i++, executions++) {
        run(seeds[i].bytes, seeds[i].size);
    }
    if (seconds > 0 && count > 0 && last_path != NULL) {
        uint8_t *last = shared_file(last_path), bytes[LONGEST];
        for (time_t end = time(NULL) + seconds; time(NULL) < end; executions++) {
            const content *seed = &seeds[below(count)];
            size_t size = seed->size;
            memcpy(bytes, seed->bytes, size);
            for (uint32_t i = 1 + below(8); i > 0; i--) {
                size = mutated(bytes, size, &seeds[below(count)]);
            }
            uint32_t length = (uint32_t)size;
            memcpy(last, &length, 4);
            memcpy(last + 4, bytes, size);
            run(bytes, size);
        }
    }
    printf("executions %ld\n", executions);
    for (uint32_t i = 0; i < count; i++) {
        free(seeds[i].bytes);
    }
    free(seeds);
    return 0;
}
