/* script.h as a program, for sanitizers: scripted serve|decode|datagrams OPTIONS_OR_CUT < script > output. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "script.h"

/* All of standard input, in memory of exactly its size, so that a read beyond it is seen. */
static uint8_t *read_all(size_t *size) {
    size_t room = 1 << 16, used = 0, got;
    uint8_t *bytes = malloc(room);
    while (bytes != NULL && (got = fread(bytes + used, 1, room - used, stdin)) > 0) {
        used += got;
        if (used == room) {
            bytes = realloc(bytes, room *= 2);
        }
    }
    *size = used;
    return bytes == NULL ? NULL : realloc(bytes, used > 0 ? used : 1);
}

int main(int argc, char **argv) {
    if (argc != 3) {
        fprintf(stderr, "scripted: expected serve|decode|datagrams OPTIONS_OR_CUT\n");
        return 2;
    }
    size_t size, room = (size_t)1 << 28, used;
    uint8_t *bytes = read_all(&size), *out = malloc(room);
    unsigned long number = strtoul(argv[2], NULL, 10);
    if (bytes == NULL || out == NULL) {
        return 2;
    }
    if (strcmp(argv[1], "serve") == 0) {
        used = script_serve(bytes, size, (uint32_t)number, "firmware_sim 1", out, room);
    } else if (strcmp(argv[1], "decode") == 0) {
        used = script_decode(bytes, size, number, out, room);
    } else {
        used = script_datagrams(bytes, size, out, room);
    }
    fwrite(out, 1, used < room ? used : room, stdout);
    free(bytes);
    free(out);
    return used <= room ? 0 : 2;
}
