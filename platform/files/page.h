// Pages to print: black, grey and text at exact positions, as a PDF or, to check them, as a picture (cairo).
//
// Lengths are millimetres of the paper, x to the right and y down from the top left corner of the page. Text is UTF-8,
// sans serif; its size is that of a line. One handle, one thread. Without cairo at build time page_open fails with a
// sentence, and all else may not be called.
#pragma once
#include "base/status.h"

struct page;

bool page_available(void); // cairo was there at build time

// Begins the first page. dpi 0: a PDF, written as output_open has it, which gets its name `path` by page_finish; else a
// picture of the last page, `path` unused. ERR_INPUT: built without cairo; a size out of range. ERR_IO, ERR_MEMORY.
// *out is NULL on error.
MUST_CHECK enum status page_open(struct page **out, const char *path, double width_mm, double height_mm, double dpi);

void page_next(struct page *page); // the next page begins, empty
void page_rectangle(struct page *page, double x, double y, double width, double height,
                    double grey); // grey: 0 black, 1 white
void page_disc(struct page *page, double x, double y, double radius, double grey);
void page_line(struct page *page, const double from[2], const double to[2], double width, double grey);
void page_text(struct page *page, double x, double y, double size, const char *text); // x, y: left end of the base line
void page_clip(struct page *page, double x, double y, double width, double height);   // until page_unclip
void page_unclip(struct page *page);

// The picture of the page so far, one byte a pixel, 255 = white; borrowed until the next call.
const uint8_t *page_pixels(struct page *page, int *width, int *height, int *stride);

// Writes the file and closes; sets *p = NULL; a picture is just closed. Errors as output_close: nothing of it is left.
MUST_CHECK enum status page_finish(struct page **p);
void page_discard(struct page **page); // closes and leaves no file; NULL is fine
