// Writes a ZIP archive in memory, by the format's own description, for what reads one.
#pragma once
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct zip_writer {
    uint8_t *bytes; // the archive so far; after zip_writer_end all of it
    size_t count, capacity;
    uint8_t *list;
    size_t list_count, list_capacity;
    int members;
};

// deflated: else stored. Errors abort. Zero-initialised to begin with.
void zip_writer_add(struct zip_writer *zip, const char *name, const void *bytes, size_t count, bool deflated);
void zip_writer_end(struct zip_writer *zip);
void zip_writer_free(struct zip_writer *zip);
