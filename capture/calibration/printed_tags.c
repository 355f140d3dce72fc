#include "capture/calibration/printed_tags.h"

#include "platform/files/json.h"
#include "platform/vision/tag_detector.h"

#include <math.h>
#include <stdio.h>

static void printed_ruler(struct page *page, struct paper_size size);

// ---------------------------------------------------------------- printed board

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

// ---------------------------------------------------------------- printed tags

const char *const paper_names[2] = {"a4", "letter"};

static const double LABEL_MM = 6, GUTTER_MM = 4, MARK_MM = 4, HAIRLINE_MM = 0.15;

struct paper_size paper_size(enum paper paper)
{
    return paper == PAPER_A4 ? (struct paper_size){210, 297} : (struct paper_size){215.9, 279.4};
}

// How tags lie on pages. A tile is a tag with its white margin of one cell, and a label below.
struct tag_layout {
    double cell, tile_w, tile_h; // mm
    double area_w, area_h;       // of a page, mm
    int columns, rows;           // tags on a page; 0: a tag takes several pages
    int part_columns, part_rows; // pages of one tag, then
};

static struct tag_layout layout_of(const struct printed_tags *wanted)
{
    const struct paper_size size = paper_size(wanted->paper);
    struct tag_layout l = {.cell = wanted->side_m * 1e3 / TAG_CELLS};
    l.tile_w = l.cell * (TAG_CELLS + 2);
    l.tile_h = l.tile_w + LABEL_MM;
    l.area_w = size.width_mm - 2 * PRINT_MARGIN_MM;
    l.area_h = size.height_mm - 2 * PRINT_MARGIN_MM - PRINT_FOOT_MM;
    l.columns = (int)floor((l.area_w + GUTTER_MM) / (l.tile_w + GUTTER_MM));
    l.rows = (int)floor((l.area_h + GUTTER_MM) / (l.tile_h + GUTTER_MM));
    if (!l.columns || !l.rows) {
        l.columns = l.rows = 0;
        l.part_columns = (int)ceil(l.tile_w / (l.area_w - 2 * MARK_MM));
        l.part_rows = (int)ceil(l.tile_h / (l.area_h - 2 * MARK_MM));
    }
    return l;
}

int printed_tags_pages(const struct printed_tags *wanted)
{
    const struct tag_layout l = layout_of(wanted);
    const int on_page = l.columns * l.rows;
    return on_page ? (wanted->count + on_page - 1) / on_page : wanted->count * l.part_columns * l.part_rows;
}

// Short lines outwards from the corners of a box: where to cut.
static void cutting_marks(struct page *page, double x, double y, double width, double height)
{
    for (int k = 0; k < 4; k++) {
        const double cx = k % 2 ? x + width : x, cy = k / 2 ? y + height : y, sx = k % 2 ? 1 : -1, sy = k / 2 ? 1 : -1;
        const double corner[2] = {cx, cy}, across[2] = {cx + sx * GUTTER_MM * 0.45, cy},
                     along[2] = {cx, cy + sy * GUTTER_MM * 0.45};
        page_line(page, corner, across, HAIRLINE_MM, 0.4);
        page_line(page, corner, along, HAIRLINE_MM, 0.4);
    }
}

static void draw_tag(struct page *page, const struct printed_tags *wanted, int32_t id, double x, double y)
{
    const struct tag_layout l = layout_of(wanted);
    struct tag_pattern pattern;
    char text[80];
    if (!tag_pattern(id, &pattern))
        return;
    // One black square and white cells on it, so that black cells have no seams.
    page_rectangle(page, x + l.cell, y + l.cell, l.cell * TAG_CELLS, l.cell * TAG_CELLS, 0);
    for (int row = 0; row < TAG_CELLS; row++)
        for (int column = 0; column < TAG_CELLS; column++)
            if (pattern.cell[row][column])
                page_rectangle(page, x + l.cell * (column + 1), y + l.cell * (row + 1), l.cell, l.cell, 1);
    snprintf(text, sizeof text, "tag36h11  %d   side %.1f mm   this way up", (int)id, wanted->side_m * 1e3);
    page_text(page, x + l.cell, y + l.tile_w + LABEL_MM * 0.55, fmin(3.2, l.tile_w / 14), text);
}

static double tick_length_mm(int mm)
{
    if (mm % 50 == 0)
        return 4;
    return mm % 10 == 0 ? 3 : 1.6;
}

// Marks at the foot of every page: a ruler of 100 mm and what to do with it. Also used for boards.
static void printed_ruler(struct page *page, struct paper_size size)
{
    const double y = size.height_mm - PRINT_MARGIN_MM - 5, x = PRINT_MARGIN_MM;
    const double from[2] = {x, y}, to[2] = {x + 100, y};
    page_line(page, from, to, 0.3, 0);
    for (int mm = 0; mm <= 100; mm += 5) {
        const double low[2] = {x + mm, y}, high[2] = {x + mm, y - tick_length_mm(mm)};
        page_line(page, low, high, 0.2, 0);
    }
    page_text(page, x + 104, y - 1.2, 3, "100 mm. If it measures otherwise, print again at");
    page_text(page, x + 104, y + 2.6, 3, "100 % (\"actual size\", no \"fit to page\").");
}

static void draw_whole(const struct printed_tags *wanted, const struct tag_layout *layout, struct page *page)
{
    const int on_page = layout->columns * layout->rows;
    for (int i = 0; i < wanted->count; i++) {
        const int at = i % on_page;
        if (i && !at)
            page_next(page);
        if (!at)
            printed_ruler(page, paper_size(wanted->paper));
        const double x = PRINT_MARGIN_MM + (at % layout->columns) * (layout->tile_w + GUTTER_MM),
                     y = PRINT_MARGIN_MM + at / layout->columns * (layout->tile_h + GUTTER_MM);
        draw_tag(page, wanted, wanted->ids[i], x, y);
        cutting_marks(page, x, y, layout->tile_w, layout->tile_h);
    }
}

// One tag over several pages: each shows a part of it, cut out where the marks are, and the parts meet edge to edge.
static void draw_parts(const struct printed_tags *wanted, const struct tag_layout *layout, int32_t id,
                       struct page *page)
{
    const double part_w = layout->tile_w / layout->part_columns, part_h = layout->tile_h / layout->part_rows;
    const double x = PRINT_MARGIN_MM + MARK_MM, y = PRINT_MARGIN_MM + MARK_MM;
    const int parts = layout->part_columns * layout->part_rows;
    for (int k = 0; k < parts; k++) {
        const int column = k % layout->part_columns, row = k / layout->part_columns;
        char text[80];
        if (k)
            page_next(page);
        printed_ruler(page, paper_size(wanted->paper));
        page_clip(page, x, y, part_w, part_h);
        draw_tag(page, wanted, id, x - column * part_w, y - row * part_h);
        page_unclip(page);
        cutting_marks(page, x, y, part_w, part_h);
        snprintf(text, sizeof text, "tag %d: row %d of %d, column %d of %d", (int)id, row + 1, layout->part_rows,
                 column + 1, layout->part_columns);
        page_text(page, x, y + part_h + MARK_MM + 3, 3, text);
    }
}

static enum status check_wanted(const struct printed_tags *wanted)
{
    if (!(wanted->side_m >= PRINTED_SIDE_MIN_M && wanted->side_m <= PRINTED_SIDE_MAX_M))
        return fail(ERR_INPUT, "a tag's side must lie between %g and %g mm, not %g", PRINTED_SIDE_MIN_M * 1e3,
                    PRINTED_SIDE_MAX_M * 1e3, wanted->side_m * 1e3);
    if (wanted->count <= 0)
        return fail(ERR_INPUT, "no tag was asked for");
    for (int i = 0; i < wanted->count; i++) {
        if (wanted->ids[i] < 0 || wanted->ids[i] >= TAG_ID_COUNT)
            return fail(ERR_INPUT, "tag36h11 has no tag %d; it has 0 to %d", (int)wanted->ids[i], TAG_ID_COUNT - 1);
        for (int k = 0; k < i; k++)
            if (wanted->ids[k] == wanted->ids[i])
                return fail(ERR_INPUT, "tag %d is asked for twice; two tags of one number cannot hang in one place",
                            (int)wanted->ids[i]);
    }
    return OK;
}

enum status printed_tags_draw(const struct printed_tags *wanted, struct page *page)
{
    enum status status = check_wanted(wanted);
    if (status != OK)
        return status;
    const struct tag_layout l = layout_of(wanted);
    if (l.columns) {
        draw_whole(wanted, &l, page);
        return OK;
    }
    for (int i = 0; i < wanted->count; i++) {
        if (i)
            page_next(page);
        draw_parts(wanted, &l, wanted->ids[i], page);
    }
    return OK;
}

enum status printed_tags_list(const struct printed_tags *wanted, char **json)
{
    struct json *root = json_new_object();
    json_add_string(root, "family", "tag36h11");
    struct json *sides = json_add_object(root, "side_m");
    for (int i = 0; i < wanted->count; i++) {
        char name[16];
        snprintf(name, sizeof name, "%d", (int)wanted->ids[i]);
        json_add_number(sides, name, wanted->side_m);
    }
    *json = json_print(root);
    json_free(&root);
    return *json ? OK : fail(ERR_MEMORY, "no memory for the list of tags");
}
