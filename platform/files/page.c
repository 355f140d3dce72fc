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

static void fresh_page(struct page *p)
{
    cairo_set_source_rgb(p->cr, 1, 1, 1);
    cairo_paint(p->cr);
}

static enum status open_surface(struct page *p, double width_mm, double height_mm, double dpi)
{
    const double per_inch = dpi > 0 ? dpi : POINTS_PER_INCH, per_mm = per_inch / MM_PER_INCH;
    p->surface = dpi > 0 ? cairo_image_surface_create(CAIRO_FORMAT_A8, (int)(width_mm * per_mm + 0.5),
                                                      (int)(height_mm * per_mm + 0.5))
                         : cairo_pdf_surface_create_for_stream(write_bytes, output_file(p->out), width_mm * per_mm,
                                                               height_mm * per_mm);
    cairo_status_t status = cairo_surface_status(p->surface);
    if (status != CAIRO_STATUS_SUCCESS)
        return status == CAIRO_STATUS_NO_MEMORY
                   ? fail(ERR_MEMORY, "no memory for a page")
                   : fail(ERR_IO, "a page cannot be made (cairo: %s)", cairo_status_to_string(status));
    p->cr = cairo_create(p->surface);
    cairo_scale(p->cr, per_mm, per_mm);
    cairo_select_font_face(p->cr, "sans-serif", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
    // A picture has one channel, its opacity, which starts at 0: there 0 is white and 1 is black.
    if (dpi <= 0)
        fresh_page(p);
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

static void set_grey(struct page *p, double grey)
{
    if (p->out) {
        cairo_set_source_rgb(p->cr, grey, grey, grey);
    } else {
        cairo_set_operator(p->cr, CAIRO_OPERATOR_SOURCE);
        cairo_set_source_rgba(p->cr, 0, 0, 0, 1 - grey);
    }
}

void page_next(struct page *p)
{
    cairo_show_page(p->cr);
    if (p->out)
        fresh_page(p);
    else {
        set_grey(p, 1);
        cairo_paint(p->cr);
    }
}

void page_rectangle(struct page *p, double x, double y, double w, double h, double grey)
{
    set_grey(p, grey);
    // Cells of a pattern share their edges: antialiasing would leave a light line between them.
    cairo_set_antialias(p->cr, CAIRO_ANTIALIAS_NONE);
    cairo_rectangle(p->cr, x, y, w, h);
    cairo_fill(p->cr);
    cairo_set_antialias(p->cr, CAIRO_ANTIALIAS_DEFAULT);
}

void page_disc(struct page *p, double x, double y, double radius, double grey)
{
    set_grey(p, grey);
    cairo_new_path(p->cr);
    cairo_arc(p->cr, x, y, radius, 0, 6.283185307179586);
    cairo_fill(p->cr);
}

void page_line(struct page *p, const double from[2], const double to[2], double width, double grey)
{
    set_grey(p, grey);
    cairo_set_line_width(p->cr, width);
    cairo_move_to(p->cr, from[0], from[1]);
    cairo_line_to(p->cr, to[0], to[1]);
    cairo_stroke(p->cr);
}

void page_text(struct page *p, double x, double y, double size, const char *text)
{
    set_grey(p, 0);
    if (!p->out)
        cairo_set_operator(p->cr, CAIRO_OPERATOR_OVER);
    cairo_set_font_size(p->cr, size);
    cairo_move_to(p->cr, x, y);
    cairo_show_text(p->cr, text);
}

void page_clip(struct page *p, double x, double y, double w, double h)
{
    cairo_save(p->cr);
    cairo_rectangle(p->cr, x, y, w, h);
    cairo_clip(p->cr);
}

void page_unclip(struct page *p) { cairo_restore(p->cr); }

const uint8_t *page_pixels(struct page *p, int *width, int *height, int *stride)
{
    cairo_surface_flush(p->surface);
    uint8_t *pixels = cairo_image_surface_get_data(p->surface);
    *width = cairo_image_surface_get_width(p->surface);
    *height = cairo_image_surface_get_height(p->surface);
    *stride = cairo_image_surface_get_stride(p->surface);
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
void page_next(struct page *p) { (void)p; }
void page_rectangle(struct page *p, double x, double y, double w, double h, double grey)
{
    (void)p, (void)x, (void)y, (void)w, (void)h, (void)grey;
}
void page_disc(struct page *p, double x, double y, double radius, double grey)
{
    (void)p, (void)x, (void)y, (void)radius, (void)grey;
}
void page_line(struct page *p, const double from[2], const double to[2], double width, double grey)
{
    (void)p, (void)from, (void)to, (void)width, (void)grey;
}
void page_text(struct page *p, double x, double y, double size, const char *text)
{
    (void)p, (void)x, (void)y, (void)size, (void)text;
}
void page_clip(struct page *p, double x, double y, double w, double h) { (void)p, (void)x, (void)y, (void)w, (void)h; }
void page_unclip(struct page *p) { (void)p; }
const uint8_t *page_pixels(struct page *p, int *width, int *height, int *stride)
{
    (void)p;
    *width = *height = *stride = 0;
    return NULL;
}
enum status page_finish(struct page **p)
{
    *p = NULL;
    return OK;
}
void page_discard(struct page **p) { *p = NULL; }

#endif
