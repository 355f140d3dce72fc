#include "capture/calibration/printed_board.h"

#include <math.h>
#include <stdio.h>

static const double PITCH_MM = 20, RADIUS_MM = 6;

static void area_of(enum paper paper, double *w, double *h)
{
    const struct paper_size size = paper_size(paper);
    *w = size.width_mm - 2 * PRINT_MARGIN_MM;
    *h = size.height_mm - 2 * PRINT_MARGIN_MM - PRINT_FOOT_MM;
}

// Of different parity, so that the board turned upside down is another one; the longer side is the columns'.
struct stereo_board printed_board(enum paper paper)
{
    double w, h;
    area_of(paper, &w, &h);
    int columns = (int)floor((h - 2 * RADIUS_MM) / PITCH_MM), rows = (int)floor((w - 2 * RADIUS_MM) / PITCH_MM);
    rows -= (columns - rows) % 2 == 0;
    return (struct stereo_board){columns, rows, PITCH_MM * 1e-3};
}

void printed_board_draw(enum paper paper, struct page *page)
{
    const struct stereo_board b = printed_board(paper);
    double w, h;
    char text[120];
    area_of(paper, &w, &h);
    const double x0 = PRINT_MARGIN_MM + 0.5 * (w - (b.rows - 1) * PITCH_MM),
                 y0 = PRINT_MARGIN_MM + 0.5 * (h - (b.columns - 1) * PITCH_MM);
    for (int c = 0; c < b.columns; c++)
        for (int r = 0; r < b.rows; r++)
            page_disc(page, x0 + r * PITCH_MM, y0 + c * PITCH_MM, RADIUS_MM, 0);
    printed_ruler(page, paper_size(paper));
    snprintf(text, sizeof text, "%d x %d circles, %g mm apart. Glue it flat on glass or a board.", b.columns, b.rows,
             PITCH_MM);
    page_text(page, PRINT_MARGIN_MM, PRINT_MARGIN_MM + h + 3, 3, text);
}

// One even and one odd, so that the board turned upside down is another one; a white edge stays around.
struct stereo_board printed_chequers(enum paper paper)
{
    double w, h;
    area_of(paper, &w, &h);
    int columns = (int)floor(h / PITCH_MM) - 1, rows = (int)floor(w / PITCH_MM) - 1;
    rows -= (columns - rows) % 2 == 0;
    return (struct stereo_board){columns, rows, PITCH_MM * 1e-3};
}

void printed_chequers_draw(enum paper paper, struct page *page)
{
    const struct stereo_board b = printed_chequers(paper);
    double w, h;
    char text[120];
    area_of(paper, &w, &h);
    const double x0 = PRINT_MARGIN_MM + 0.5 * (w - (b.rows + 1) * PITCH_MM),
                 y0 = PRINT_MARGIN_MM + 0.5 * (h - (b.columns + 1) * PITCH_MM);
    for (int c = 0; c <= b.columns; c++)
        for (int r = c % 2; r <= b.rows; r += 2)
            page_rectangle(page, x0 + r * PITCH_MM, y0 + c * PITCH_MM, PITCH_MM, PITCH_MM, 0);
    printed_ruler(page, paper_size(paper));
    snprintf(text, sizeof text, "%d x %d inner corners, %g mm apart. Glue it flat on glass or a board.", b.columns,
             b.rows, PITCH_MM);
    page_text(page, PRINT_MARGIN_MM, PRINT_MARGIN_MM + h + 3, 3, text);
}

void printed_discs_draw(enum paper paper, int count, double radius_m, struct page *page)
{
    double w, h;
    area_of(paper, &w, &h);
    const double radius = radius_m * 1e3, step = 2 * radius + 4;
    const int across = (int)fmax(1, floor((w + 4) / step)), down = (int)fmax(1, floor((h + 4) / step));
    for (int i = 0; i < count; i++) {
        const int at = i % (across * down);
        if (i && !at)
            page_next(page);
        if (!at)
            printed_ruler(page, paper_size(paper));
        page_disc(page, PRINT_MARGIN_MM + radius + at % across * step, PRINT_MARGIN_MM + radius + at / across * step,
                  radius, 0);
    }
}
