#include "platform/files/page.h"

#include "platform/files/output.h"

#include <stdio.h>
#include <stdlib.h>

static const double MM_PER_INCH = 25.4, POINTS_PER_INCH = 72;

#ifdef HAVE_CAIRO
#include <cairo-pdf.h>

struct page {
    cairo_surface_t *surface;
    cairo_t *cr;
    struct output *out; // NULL for a picture
};

static cairo_status_t write_bytes(void *file, const unsigned char *bytes, unsigned count)
{
    return fwrite(bytes, 1, count, file) == count ? CAIRO_STATUS_SUCCESS : CAIRO_STATUS_WRITE_ERROR;
}

bool page_available(void) { return true; }

static void fresh_page(struct page *page)
{
    cairo_set_source_rgb(page->cr, 1, 1, 1);
    cairo_paint(page->cr);
}

static enum status open_surface(struct page *page, double width_mm, double height_mm, double dpi)
{
    const double per_inch = dpi > 0 ? dpi : POINTS_PER_INCH, per_mm = per_inch / MM_PER_INCH;
    page->surface = dpi > 0 ? cairo_image_surface_create(CAIRO_FORMAT_A8, (int)(width_mm * per_mm + 0.5),
                                                         (int)(height_mm * per_mm + 0.5))
                            : cairo_pdf_surface_create_for_stream(write_bytes, output_file(page->out),
                                                                  width_mm * per_mm, height_mm * per_mm);
    cairo_status_t status = cairo_surface_status(page->surface);
    if (status != CAIRO_STATUS_SUCCESS)
        return status == CAIRO_STATUS_NO_MEMORY
                   ? fail(ERR_MEMORY, "no memory for a page")
                   : fail(ERR_IO, "a page cannot be made (cairo: %s)", cairo_status_to_string(status));
    page->cr = cairo_create(page->surface);
    cairo_scale(page->cr, per_mm, per_mm);
    cairo_select_font_face(page->cr, "sans-serif", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
    // A picture has one channel, its opacity, which starts at 0: there 0 is white and 1 is black.
    if (dpi <= 0)
        fresh_page(page);
    return OK;
}

enum status page_open(struct page **out, const char *path, double width_mm, double height_mm, double dpi)
{
    *out = NULL;
    if (!(width_mm >= 10 && width_mm <= 5000 && height_mm >= 10 && height_mm <= 5000 && dpi >= 0 && dpi <= 1200))
        return fail(ERR_INPUT, "a page of %g x %g mm cannot be made", width_mm, height_mm);
    struct page *p = calloc(1, sizeof *p);
    if (!p)
        return fail(ERR_MEMORY, "no memory for a page");
    enum status status = dpi > 0 ? OK : output_open(&p->out, path);
    if (status == OK)
        status = open_surface(p, width_mm, height_mm, dpi);
    if (status != OK)
        page_discard(&p);
    *out = p;
    return status;
}

static void set_grey(struct page *page, double grey)
{
    if (page->out) {
        cairo_set_source_rgb(page->cr, grey, grey, grey);
    } else {
        cairo_set_operator(page->cr, CAIRO_OPERATOR_SOURCE);
        cairo_set_source_rgba(page->cr, 0, 0, 0, 1 - grey);
    }
}

void page_next(struct page *page)
{
    cairo_show_page(page->cr);
    if (page->out)
        fresh_page(page);
    else {
        set_grey(page, 1);
        cairo_paint(page->cr);
    }
}

void page_rectangle(struct page *page, double x, double y, double width, double height, double grey)
{
    set_grey(page, grey);
    // Cells of a pattern share their edges: antialiasing would leave a light line between them.
    cairo_set_antialias(page->cr, CAIRO_ANTIALIAS_NONE);
    cairo_rectangle(page->cr, x, y, width, height);
    cairo_fill(page->cr);
    cairo_set_antialias(page->cr, CAIRO_ANTIALIAS_DEFAULT);
}

void page_disc(struct page *page, double x, double y, double radius, double grey)
{
    set_grey(page, grey);
    cairo_new_path(page->cr);
    cairo_arc(page->cr, x, y, radius, 0, 6.283185307179586);
    cairo_fill(page->cr);
}

void page_line(struct page *page, const double from[2], const double to[2], double width, double grey)
{
    set_grey(page, grey);
    cairo_set_line_width(page->cr, width);
    cairo_move_to(page->cr, from[0], from[1]);
    cairo_line_to(page->cr, to[0], to[1]);
    cairo_stroke(page->cr);
}

void page_text(struct page *page, double x, double y, double size, const char *text)
{
    set_grey(page, 0);
    if (!page->out)
        cairo_set_operator(page->cr, CAIRO_OPERATOR_OVER);
    cairo_set_font_size(page->cr, size);
    cairo_move_to(page->cr, x, y);
    cairo_show_text(page->cr, text);
}

void page_clip(struct page *page, double x, double y, double width, double height)
{
    cairo_save(page->cr);
    cairo_rectangle(page->cr, x, y, width, height);
    cairo_clip(page->cr);
}

void page_unclip(struct page *page) { cairo_restore(page->cr); }

const uint8_t *page_pixels(struct page *page, int *width, int *height, int *stride)
{
    cairo_surface_flush(page->surface);
    uint8_t *pixels = cairo_image_surface_get_data(page->surface);
    *width = cairo_image_surface_get_width(page->surface);
    *height = cairo_image_surface_get_height(page->surface);
    *stride = cairo_image_surface_get_stride(page->surface);
    return pixels;
}

// Ends the surface, which writes what it still holds, and then the file.
static enum status end_page(struct page **out, enum status status)
{
    struct page *p = *out;
    if (p->cr)
        cairo_destroy(p->cr);
    if (p->surface) {
        cairo_surface_finish(p->surface);
        const cairo_status_t ended = cairo_surface_status(p->surface);
        if (status == OK && ended != CAIRO_STATUS_SUCCESS)
            status = fail(ERR_IO, "the pages cannot be written; is the disk full? (cairo: %s)",
                          cairo_status_to_string(ended));
        cairo_surface_destroy(p->surface);
    }
    status = output_close(&p->out, status);
    free(p);
    *out = NULL;
    return status;
}

void page_discard(struct page **out)
{
    if (*out)
        (void)end_page(out, ERR_IO); // the caller's sentence stays
}

enum status page_finish(struct page **out)
{
    cairo_show_page((*out)->cr);
    return end_page(out, OK);
}

#else

bool page_available(void) { return false; }
enum status page_open(struct page **out, const char *path, double width_mm, double height_mm, double dpi)
{
    (void)path, (void)width_mm, (void)height_mm, (void)dpi, (void)MM_PER_INCH, (void)POINTS_PER_INCH;
    *out = NULL;
    return fail(ERR_INPUT, "this program was built without cairo and cannot make pages to print; install libcairo2-dev "
                           "and build again");
}
void page_next(struct page *page) { (void)page; }
void page_rectangle(struct page *page, double x, double y, double width, double height, double grey)
{
    (void)page, (void)x, (void)y, (void)width, (void)height, (void)grey;
}
void page_disc(struct page *page, double x, double y, double radius, double grey)
{
    (void)page, (void)x, (void)y, (void)radius, (void)grey;
}
void page_line(struct page *page, const double from[2], const double to[2], double width, double grey)
{
    (void)page, (void)from, (void)to, (void)width, (void)grey;
}
void page_text(struct page *page, double x, double y, double size, const char *text)
{
    (void)page, (void)x, (void)y, (void)size, (void)text;
}
void page_clip(struct page *page, double x, double y, double width, double height)
{
    (void)page, (void)x, (void)y, (void)width, (void)height;
}
void page_unclip(struct page *page) { (void)page; }
const uint8_t *page_pixels(struct page *page, int *width, int *height, int *stride)
{
    (void)page;
    *width = *height = *stride = 0;
    return NULL;
}
enum status page_finish(struct page **p)
{
    *p = NULL;
    return OK;
}
void page_discard(struct page **page) { *page = NULL; }

#endif
