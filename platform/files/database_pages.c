#include "platform/files/database_pages.h"

#include <stdlib.h>
#include <string.h>

// Offsets in a file's header.
enum {
    PAGE_BYTES_AT = 16, // 1 stands for 65536
    COUNTER_AT = 24,
    PAGES_AT = 28,
    PAGES_VALID_AT = 92, // the counter when the number of pages was written
};

// A page without rows has less than 16 bytes that are not 0.
enum { TELLING_BYTES = 64 };

uint32_t database_number_at(const uint8_t *at)
{
    return (uint32_t)at[0] << 24 | (uint32_t)at[1] << 16 | (uint32_t)at[2] << 8 | at[3];
}

bool overlay_add(struct page_overlay *overlay, uint32_t number, int64_t at)
{
    if (overlay->count == overlay->capacity) {
        const size_t capacity = overlay->capacity ? overlay->capacity * 2 : 64;
        struct overlay_page *grown = realloc(overlay->pages, capacity * sizeof *grown);
        if (!grown)
            return false;
        overlay->pages = grown;
        overlay->capacity = capacity;
    }
    overlay->pages[overlay->count++] = (struct overlay_page){number, at};
    return true;
}

static int by_number_and_place(const void *a, const void *b)
{
    const struct overlay_page *one = a, *other = b;
    if (one->number != other->number)
        return one->number < other->number ? -1 : 1;
    return one->at < other->at ? -1 : one->at > other->at;
}

void overlay_sort(struct page_overlay *overlay)
{
    size_t kept = 0;
    if (overlay->count)
        qsort(overlay->pages, overlay->count, sizeof *overlay->pages, by_number_and_place);
    for (size_t i = 0; i < overlay->count; i++) {
        kept -= kept && overlay->pages[kept - 1].number == overlay->pages[i].number;
        overlay->pages[kept++] = overlay->pages[i];
    }
    overlay->count = kept;
}

const struct overlay_page *overlay_find(const struct page_overlay *overlay, uint32_t number)
{
    size_t first = 0, end = overlay->count;
    while (first < end) {
        const size_t middle = first + (end - first) / 2;
        if (overlay->pages[middle].number == number)
            return &overlay->pages[middle];
        if (overlay->pages[middle].number < number)
            first = middle + 1;
        else
            end = middle;
    }
    return NULL;
}

void overlay_free(struct page_overlay *overlay)
{
    free(overlay->pages);
    *overlay = (struct page_overlay){0};
}

uint32_t page_one_page_bytes(const uint8_t header[DATABASE_HEADER_BYTES])
{
    const uint32_t bytes = (uint32_t)header[PAGE_BYTES_AT] << 8 | header[PAGE_BYTES_AT + 1];
    const uint32_t page = bytes == 1 ? DATABASE_PAGE_MAX : bytes;
    return page >= 512 && !(page & (page - 1)) ? page : 0;
}

static void find_mark(char mark[DATABASE_MARK_DIGITS + 1], const uint8_t *page, size_t count)
{
    static const char begin[] = DATABASE_MARK_BEGIN;
    const size_t length = sizeof begin - 1;
    mark[0] = 0;
    for (size_t i = 0; i + length + DATABASE_MARK_DIGITS < count; i++)
        if (page[i] == (uint8_t)begin[0] && !memcmp(page + i, begin, length) &&
            page[i + length + DATABASE_MARK_DIGITS] == '\'') {
            memcpy(mark, page + i + length, DATABASE_MARK_DIGITS);
            mark[DATABASE_MARK_DIGITS] = 0;
            return;
        }
}

bool page_one_read(struct page_one *out, const uint8_t *page, size_t count)
{
    static const char magic[] = "SQLite format 3";
    *out = (struct page_one){0};
    if (count < DATABASE_HEADER_BYTES || memcmp(page, magic, sizeof magic))
        return false;
    memcpy(out->header, page, sizeof out->header);
    out->counter = database_number_at(page + COUNTER_AT);
    out->pages = database_number_at(page + PAGES_VALID_AT) == out->counter ? database_number_at(page + PAGES_AT) : 0;
    find_mark(out->mark, page, count);
    return true;
}

bool page_one_same_header(const struct page_one *one, const struct page_one *other)
{
    return !memcmp(one->header, other->header, sizeof one->header);
}

bool page_one_marks_differ(const struct page_one *one, const struct page_one *other)
{
    return *one->mark && *other->mark && strcmp(one->mark, other->mark);
}

bool page_one_marks_agree(const struct page_one *one, const struct page_one *other)
{
    return *one->mark && *other->mark && !strcmp(one->mark, other->mark);
}

static bool is_telling(const uint8_t *page, uint32_t page_bytes)
{
    uint32_t set = 0;
    for (uint32_t i = 0; i < page_bytes && set < TELLING_BYTES; i++)
        set += page[i] != 0;
    return set >= TELLING_BYTES;
}

bool page_is_in_file(const struct byte_source *file, uint32_t number, const uint8_t *page, uint8_t *scratch,
                     uint32_t page_bytes)
{
    return is_telling(page, page_bytes) &&
           file->read(file->from, scratch, page_bytes, (int64_t)(number - 1) * page_bytes) &&
           !memcmp(scratch, page, page_bytes);
}
