#include "app/ui/theme.h"

#include <math.h>

// ---------------------------------------------------------------- icons

// Where one icon is drawn: 24 units a side, strokes 2 units wide.
struct icon_grid {
    struct ui *ui;
    double x, y, unit;
    uint32_t color;
};

static const double PI = 3.14159265358979323846, STROKE = 2;

static struct ui_point grid_point(const struct icon_grid *grid, double x, double y)
{
    return (struct ui_point){grid->x + x * grid->unit, grid->y + y * grid->unit};
}

// x0 y0 x1 y1 …
static void stroke_polyline(const struct icon_grid *grid, const double *xy, int count, bool closed)
{
    struct ui_point points[16];
    assert(count <= (int)COUNT_OF(points));
    for (int i = 0; i < count; i++)
        points[i] = grid_point(grid, xy[2 * i], xy[2 * i + 1]);
    ui_stroke(grid->ui, points, count, closed, STROKE * grid->unit, grid->color);
}
#define STROKES(g, closed, ...)                                                                                        \
    stroke_polyline(g, (const double[]){__VA_ARGS__}, (int)COUNT_OF(((const double[]){__VA_ARGS__})) / 2, closed)

static void fill_polygon(const struct icon_grid *grid, const double *xy, int count)
{
    struct ui_point points[8];
    assert(count <= (int)COUNT_OF(points));
    for (int i = 0; i < count; i++)
        points[i] = grid_point(grid, xy[2 * i], xy[2 * i + 1]);
    ui_polygon(grid->ui, points, count, grid->color);
    ui_stroke(grid->ui, points, count, true, grid->unit, grid->color); // rounded corners
}
#define SOLID(g, ...) fill_polygon(g, (const double[]){__VA_ARGS__}, (int)COUNT_OF(((const double[]){__VA_ARGS__})) / 2)

static void fill_dot(const struct icon_grid *grid, double x, double y, double r)
{
    ui_disc(grid->ui, grid_point(grid, x, y), r * grid->unit, grid->color);
}

static void stroke_box(const struct icon_grid *grid, double x, double y, double width, double height, double round)
{
    struct ui_point at = grid_point(grid, x, y);
    ui_border(grid->ui, (struct ui_box){at.x, at.y, width * grid->unit, height * grid->unit}, round * grid->unit,
              STROKE * grid->unit, grid->color);
}

static void fill_bar(const struct icon_grid *grid, double x, double y, double width, double height)
{
    struct ui_point at = grid_point(grid, x, y);
    ui_fill(grid->ui, (struct ui_box){at.x, at.y, width * grid->unit, height * grid->unit}, grid->unit, grid->color);
}

static void draw_sun(const struct icon_grid *grid)
{
    fill_dot(grid, 12, 12, 4.2);
    for (int i = 0; i < 8; i++) {
        double c = cos(i * PI / 4), s = sin(i * PI / 4);
        STROKES(grid, false, 12 + 7.5 * c, 12 + 7.5 * s, 12 + 9.5 * c, 12 + 9.5 * s);
    }
}

// The outline of a disc of radius 8.5 about (12, 12) minus one of radius 6.5 about (15.5, 8.5), which meet at these
// angles.
static void draw_moon(const struct icon_grid *grid)
{
    enum { OUTER = 28, INNER = 14 };
    struct ui_point rim[OUTER + INNER];
    for (int i = 0; i < OUTER; i++) {
        double a = (4.6 + 260.8 * i / (OUTER - 1)) * PI / 180;
        rim[i] = grid_point(grid, 12 + 8.5 * cos(a), 12 + 8.5 * sin(a));
    }
    for (int i = 0; i < INNER; i++) {
        double a = (229.9 - 189.8 * i / (INNER - 1)) * PI / 180;
        rim[OUTER + i] = grid_point(grid, 15.5 + 6.5 * cos(a), 8.5 + 6.5 * sin(a));
    }
    ui_stroke(grid->ui, rim, OUTER + INNER, true, STROKE * grid->unit, grid->color);
}

static void draw_bones(const struct icon_grid *grid)
{
    ui_ring(grid->ui, grid_point(grid, 12, 4.5), 2.2 * grid->unit, STROKE * grid->unit, grid->color);
    STROKES(grid, false, 12, 7.5, 12, 14);
    STROKES(grid, false, 5.5, 9.5, 12, 8.8, 18.5, 9.5);
    STROKES(grid, false, 8, 21.5, 12, 14, 16, 21.5);
}

static void draw_layers(const struct icon_grid *grid)
{
    STROKES(grid, true, 12, 3.5, 21, 8.5, 12, 13.5, 3, 8.5);
    STROKES(grid, false, 3, 12.5, 12, 17.5, 21, 12.5);
    STROKES(grid, false, 3, 16.5, 12, 21.5, 21, 16.5);
}

static void draw_move(const struct icon_grid *grid)
{
    STROKES(grid, false, 12, 3, 12, 21);
    STROKES(grid, false, 3, 12, 21, 12);
    STROKES(grid, false, 9.5, 5.5, 12, 3, 14.5, 5.5);
    STROKES(grid, false, 9.5, 18.5, 12, 21, 14.5, 18.5);
    STROKES(grid, false, 5.5, 9.5, 3, 12, 5.5, 14.5);
    STROKES(grid, false, 18.5, 9.5, 21, 12, 18.5, 14.5);
}

static void draw_orbit(const struct icon_grid *grid)
{
    struct ui_point ellipse[28];
    for (int i = 0; i < 28; i++) {
        double a = -0.55 * PI + i * 1.62 * PI / 27;
        ellipse[i] = grid_point(grid, 12 + 9.5 * cos(a), 12.5 + 4 * sin(a));
    }
    ui_stroke(grid->ui, ellipse, 28, false, STROKE * grid->unit, grid->color);
    STROKES(grid, false, 1.2, 8.8, 2.6, 11.8, 5.6, 10.4);
    fill_dot(grid, 12, 5.2, 2.2);
    STROKES(grid, false, 12, 9, 12, 18.5);
}

static void draw_camera(const struct icon_grid *grid)
{
    stroke_box(grid, 2.5, 6.5, 13.5, 11, 2.5);
    STROKES(grid, true, 16, 11, 21.5, 8, 21.5, 16, 16, 13);
}

static void draw_photo(const struct icon_grid *grid)
{
    STROKES(grid, true, 3, 7.5, 7.2, 7.5, 9, 4.5, 15, 4.5, 16.8, 7.5, 21, 7.5, 21, 19, 3, 19);
    ui_ring(grid->ui, grid_point(grid, 12, 13), 3.6 * grid->unit, STROKE * grid->unit, grid->color);
}

static void draw_more(const struct icon_grid *grid, enum icon icon)
{
    switch (icon) {
    case ICON_BACK: STROKES(grid, false, 14.5, 5, 7.5, 12, 14.5, 19); break;
    case ICON_CLOSE:
        STROKES(grid, false, 6, 6, 18, 18);
        STROKES(grid, false, 18, 6, 6, 18);
        break;
    case ICON_CHECK: STROKES(grid, false, 5, 12.5, 10, 17.5, 19.5, 7); break;
    case ICON_TAG:
        stroke_box(grid, 3, 3, 18, 18, 2);
        fill_bar(grid, 7.5, 7.5, 4.5, 4.5);
        fill_bar(grid, 12, 12, 4.5, 4.5);
        break;
    case ICON_WARNING:
        STROKES(grid, true, 12, 3.5, 21.5, 20, 2.5, 20);
        STROKES(grid, false, 12, 9.5, 12, 14);
        fill_dot(grid, 12, 17, 1.2);
        break;
    case ICON_DROPS:
        ui_ring(grid->ui, grid_point(grid, 9, 9), 5 * grid->unit, STROKE * grid->unit, grid->color);
        fill_dot(grid, 16, 15, 5);
        break;
    case ICON_INSET:
        stroke_box(grid, 2.5, 4.5, 19, 15, 2.5);
        fill_bar(grid, 12, 11.5, 6.5, 5);
        break;
    case ICON_MAP:
        STROKES(grid, true, 3, 6, 9, 3.5, 15, 6, 21, 3.5, 21, 18, 15, 20.5, 9, 18, 3, 20.5);
        STROKES(grid, false, 9, 3.5, 9, 18);
        STROKES(grid, false, 15, 6, 15, 20.5);
        break;
    case ICON_FIND:
        ui_ring(grid->ui, grid_point(grid, 10.5, 10.5), 6.5 * grid->unit, STROKE * grid->unit, grid->color);
        STROKES(grid, false, 15.5, 15.5, 21, 21);
        break;
    case ICON_ROOM:
        STROKES(grid, true, 3, 3.5, 21, 3.5, 21, 20.5, 3, 20.5);
        STROKES(grid, true, 8, 8, 16, 8, 16, 15.5, 8, 15.5);
        STROKES(grid, false, 3, 20.5, 8, 15.5);
        STROKES(grid, false, 21, 20.5, 16, 15.5);
        break;
    case ICON_COMPARE: // two people
        for (int x = 7; x <= 17; x += 10) {
            fill_dot(grid, x, 5, 2.2);
            STROKES(grid, false, x, 9, x, 14.5);
            STROKES(grid, false, x - 3.0, 20.5, x, 14.5, x + 3.0, 20.5);
        }
        break;
    case ICON_BARS: fill_bar(grid, 4, 13, 3, 7), fill_bar(grid, 10.5, 8, 3, 12), fill_bar(grid, 17, 4, 3, 16); break;
    default: break;
    }
}

void icon_draw(struct ui *ui, enum icon icon, struct ui_point centre, double size, uint32_t color)
{
    const struct icon_grid grid = {ui, centre.x - size / 2, centre.y - size / 2, size / 24, color}, *g = &grid;
    switch (icon) {
    case ICON_PLAY: SOLID(g, 8, 5, 19, 12, 8, 19); break;
    case ICON_PAUSE: fill_bar(g, 6.5, 5, 4, 14), fill_bar(g, 13.5, 5, 4, 14); break;
    case ICON_STEP_BACK: fill_bar(g, 5, 6, 2.5, 12), SOLID(g, 18, 6.5, 18, 17.5, 9.5, 12); break;
    case ICON_STEP_ON: fill_bar(g, 16.5, 6, 2.5, 12), SOLID(g, 6, 6.5, 14.5, 12, 6, 17.5); break;
    case ICON_LOOP:
        STROKES(g, false, 4, 12, 4, 10, 6, 7.5, 19, 7.5);
        STROKES(g, false, 16, 4.5, 19.2, 7.5, 16, 10.5);
        STROKES(g, false, 20, 12, 20, 14, 18, 16.5, 5, 16.5);
        STROKES(g, false, 8, 13.5, 4.8, 16.5, 8, 19.5);
        break;
    case ICON_MIRROR:
        STROKES(g, false, 12, 3.5, 12, 20.5);
        STROKES(g, true, 8.5, 7, 8.5, 17, 2.5, 17);
        SOLID(g, 15.5, 7, 15.5, 17, 21.5, 17);
        break;
    case ICON_LAYERS: draw_layers(g); break;
    case ICON_PHOTO: draw_photo(g); break;
    case ICON_ORBIT: draw_orbit(g); break;
    case ICON_CAMERA: draw_camera(g); break;
    case ICON_MOVE: draw_move(g); break;
    case ICON_SUN: draw_sun(g); break;
    case ICON_MOON: draw_moon(g); break;
    case ICON_BONES: draw_bones(g); break;
    default: draw_more(g, icon); break;
    }
}

// ---------------------------------------------------------------- theme

// Inter, by Rasmus Andersson, SIL Open Font License; FONT_FOLDER is set by the build.
#define FONT(name, file)                                                                                               \
    __asm__(".section .rodata\n"                                                                                       \
            ".balign 16\n"                                                                                             \
            ".global " #name "\n" #name ":\n"                                                                          \
            ".incbin \"" FONT_FOLDER "/" file "\"\n"                                                                   \
            ".global " #name "_end\n" #name "_end:\n"                                                                  \
            ".byte 0\n"                                                                                                \
            ".previous\n");                                                                                            \
    extern const uint8_t name[], name##_end[];
FONT(font_regular, "Inter-Regular.otf")
FONT(font_medium, "Inter-SemiBold.otf")

const struct ui_face *theme_faces(void)
{
    static struct ui_face faces[FACE_COUNT];
    const size_t regular = (size_t)(font_regular_end - font_regular), medium = (size_t)(font_medium_end - font_medium);
    faces[FACE_TINY] = (struct ui_face){.bytes = font_regular, .count = regular, .size = 14};
    faces[FACE_SMALL] = (struct ui_face){.bytes = font_regular, .count = regular, .size = 16};
    faces[FACE_BODY] = (struct ui_face){.bytes = font_regular, .count = regular, .size = 20};
    faces[FACE_STRONG] = (struct ui_face){.bytes = font_medium, .count = medium, .size = 20};
    faces[FACE_HEAD] = (struct ui_face){.bytes = font_medium, .count = medium, .size = 25};
    faces[FACE_TITLE] = (struct ui_face){.bytes = font_medium, .count = medium, .size = 40};
    faces[FACE_CUE] = (struct ui_face){.bytes = font_medium, .count = medium, .size = 64, .ascii_only = true};
    faces[FACE_COUNT_IN] = (struct ui_face){.bytes = font_medium, .count = medium, .size = 110, .digits_only = true};
    return faces;
}

static const struct theme dark = {
    .ground = 0x0d1014ff,
    .surface = 0x171b21ff,
    .glass = 0x14181ee8,
    .raised = 0x262c35ff,
    .hairline = 0xffffff1c,
    .text = 0xf2f4f7ff,
    .quiet = 0xa7b0bdff,
    .accent = 0x2dd4bfff,
    .on_accent = 0x04211dff,
    .warn = 0xfbbf24ff,
    .ghost = 0x7cb7ffff,
    .right = 0x34d399ff,
    .wrong = 0xff6b4aff,
    .unseen = 0xb4bcc8ff,
    .shadow = 0x000000a0,
    .sky = 0x2a313bff,
    .floor = 0x13171dff,
    .grid = 0xffffff2a,
};
static const struct theme light = {
    .ground = 0xf3f4f6ff,
    .surface = 0xffffffff,
    .glass = 0xfffffff0,
    .raised = 0xe9ecf0ff,
    .hairline = 0x00000018,
    .text = 0x12161cff,
    .quiet = 0x5a6472ff,
    .accent = 0x0b8578ff,
    .on_accent = 0xffffffff,
    .warn = 0xb45309ff,
    .ghost = 0x2563ebff,
    .right = 0x0d9568ff,
    .wrong = 0xd9381eff,
    .unseen = 0x7a8594ff,
    .shadow = 0x1b253540,
    .sky = 0xfafbfcff,
    .floor = 0xccd2daff,
    .grid = 0x1b253528,
};

const struct theme *theme_of(bool is_dark) { return is_dark ? &dark : &light; }

uint32_t faint(uint32_t color, double share)
{
    return (color & ~255U) | (uint32_t)lround((color & 255) * fmin(fmax(share, 0), 1));
}
