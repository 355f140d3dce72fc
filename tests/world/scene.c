#include "tests/world/scene.h"

#include "tests/world/numbers.h"
#include "tests/world/paint.h"
#include "tests/world/tag_bitmap.h"

#include <stdlib.h>
#include <string.h>

// corner + u * [0, width] + v * [0, height]
struct rectangle {
    struct vec3 corner, u, v;
    double width, height;
};

static void add_surface(struct world_scene *s, struct rectangle r, enum material material, uint32_t color)
{
    assert(s->surface_count < MAX_SURFACES);
    struct room_surface *f = &s->surfaces[s->surface_count++];
    *f = (struct room_surface){r.corner, r.u, r.v, v3_cross(r.u, r.v), r.width, r.height, material, {0}, 0, 0, NULL, 0};
    for (int c = 0; c < 3; c++)
        f->tint[c] = 0.9f * srgb_to_linear((uint8_t)(color >> (16 - 8 * c)));
}

static void add_room(struct world_scene *s)
{
    double x = ROOM_HALF_X, y = ROOM_HALF_Y, h = ROOM_HEIGHT;
    struct vec3 ex = v3(1, 0, 0), ey = v3(0, 1, 0), ez = v3(0, 0, 1), mx = v3(-1, 0, 0), my = v3(0, -1, 0);
    add_surface(s, (struct rectangle){v3(-x, -y, 0), ex, ey, 2 * x, 2 * y}, MATERIAL_FLOOR, 0xb98a5a);
    add_surface(s, (struct rectangle){v3(-x, y, h), ex, my, 2 * x, 2 * y}, MATERIAL_CEILING, 0xf3f0ea);
    add_surface(s, (struct rectangle){v3(x, -y, 0), mx, ez, 2 * x, h}, MATERIAL_WALL, 0xe9e2d4);
    add_surface(s, (struct rectangle){v3(-x, y, 0), ex, ez, 2 * x, h}, MATERIAL_WALL, 0xe9e2d4);
    add_surface(s, (struct rectangle){v3(-x, -y, 0), ey, ez, 2 * y, h}, MATERIAL_WALL, 0xe4e0d8);
    add_surface(s, (struct rectangle){v3(x, y, 0), my, ez, 2 * y, h}, MATERIAL_WALL, 0xe4e0d8);
}

static int add_box(struct world_scene *s, struct vec3 a, struct vec3 b, enum material m, uint32_t color)
{
    assert(s->box_count < MAX_BOXES);
    struct vec3 ex = v3(1, 0, 0), ey = v3(0, 1, 0), ez = v3(0, 0, 1), mx = v3(-1, 0, 0), my = v3(0, -1, 0);
    s->boxes[s->box_count] = (struct room_box){a, b, s->surface_count};
    double dx = b.x - a.x, dy = b.y - a.y, dz = b.z - a.z;
    add_surface(s, (struct rectangle){v3(a.x, b.y, a.z), my, ez, dy, dz}, m, color);
    add_surface(s, (struct rectangle){v3(b.x, a.y, a.z), ey, ez, dy, dz}, m, color);
    add_surface(s, (struct rectangle){v3(a.x, a.y, a.z), ex, ez, dx, dz}, m, color);
    add_surface(s, (struct rectangle){v3(b.x, b.y, a.z), mx, ez, dx, dz}, m, color);
    add_surface(s, (struct rectangle){v3(a.x, b.y, a.z), ex, my, dx, dy}, m, color);
    add_surface(s, (struct rectangle){v3(a.x, a.y, b.z), ex, ey, dx, dy}, m, color);
    return s->box_count++;
}

struct decal_spot {
    int surface;
    double u, v, width, height; // its centre and its size
    double rotation_deg;        // anticlockwise
};

// Adds the next free decal; the caller fills its texture.
static struct decal *add_decal(struct world_scene *s, struct decal_spot spot)
{
    assert(s->decal_count < MAX_DECALS);
    s->surfaces[spot.surface].decals |= 1ULL << s->decal_count;
    struct decal *d = &s->decals[s->decal_count++];
    double a = spot.rotation_deg * 3.14159265358979323846 / 180;
    *d = (struct decal){.surface = spot.surface,
                        .u = spot.u,
                        .v = spot.v,
                        .width = spot.width,
                        .height = spot.height,
                        .cosine = cos(a),
                        .sine = sin(a)};
    return d;
}

static const struct {
    int side;
    double u, v, side_m, rotation_deg;
} tag_spots[TAG_COUNT] = {
    {SIDE_BACK, 1.95, 1.27, 0.20, 0},   {SIDE_BACK, 4.30, 1.62, 0.20, 3},   {SIDE_RIGHT, 2.75, 1.42, 0.20, -2},
    {SIDE_RIGHT, 4.85, 1.20, 0.20, 0},  {SIDE_LEFT, 3.05, 1.28, 0.20, 1},   {SIDE_LEFT, 5.10, 1.50, 0.20, 0},
    {SIDE_REAR, 2.90, 1.36, 0.20, 0},   {SIDE_REAR, 5.00, 1.50, 0.20, -3},  {SIDE_FLOOR, 3.40, 5.55, 0.24, 4},
    {SIDE_FLOOR, 1.60, 2.05, 0.24, 25}, {SIDE_FLOOR, 5.05, 2.45, 0.24, 90}, {SIDE_BACK, 0.24, 1.15, 0.20, 0},
    {SIDE_LEFT, 4.20, 0.58, 0.20, 0},   {SIDE_RIGHT, 0.60, 0.62, 0.20, 2},  {SIDE_REAR, 3.80, 0.78, 0.20, 0},
};

static enum status add_tags(struct world_scene *s, uint32_t hang, const struct world_moved *moved)
{
    enum { TEXELS = 24 }; // texels a cell: fine enough that the filter never resolves them
    for (int i = 0; i < TAG_COUNT; i++) {
        if (!(hang >> i & 1))
            continue;
        double side = tag_spots[i].side_m, whole = side * TAG_CELLS / (TAG_CELLS - 2);
        const bool is_moved = moved->tags >> i & 1;
        const double right = tag_spots[i].u + (is_moved ? moved->right : 0);
        const double up = tag_spots[i].v + (is_moved ? moved->up : 0);
        struct decal *d =
            add_decal(s, (struct decal_spot){tag_spots[i].side, right, up, whole, whole, tag_spots[i].rotation_deg});
        d->tag = true;
        bool white[TAG_CELLS][TAG_CELLS];
        enum status status = tag_bitmap(i, white);
        if (!status)
            status = texture_make(&d->texture, TAG_CELLS * TEXELS, TAG_CELLS * TEXELS);
        if (status)
            return status;
        for (int y = 0; y < TAG_CELLS * TEXELS; y++)
            for (int x = 0; x < TAG_CELLS * TEXELS; x++) {
                float c = white[TAG_CELLS - 1 - y / TEXELS][x / TEXELS] ? 0.80f : 0.025f;
                texture_set(&d->texture, x, y, (float[3]){c, c, c});
            }
        texture_finish(&d->texture);
        const struct room_surface *f = &s->surfaces[d->surface];
        struct vec3 u = v3_add(v3_scale(f->u, d->cosine), v3_scale(f->v, d->sine)), v = v3_cross(f->normal, u);
        double m[3][3] = {{u.x, v.x, f->normal.x}, {u.y, v.y, f->normal.y}, {u.z, v.z, f->normal.z}};
        struct vec3 at = v3_add(f->corner, v3_add(v3_scale(f->u, d->u), v3_scale(f->v, d->v)));
        s->tags[s->tag_count++] =
            (struct place_tag){.id = i, .side_m = side, .world_from_tag = {quat_from_matrix(m), at}};
    }
    return OK;
}

static enum status add_painting(struct world_scene *s, struct decal_spot spot, enum painting kind, uint32_t seed)
{
    struct decal *d = add_decal(s, spot);
    if (kind == PAINTING_WINDOW)
        d->glow = 1.0f;
    if (s->plain) {
        enum status status = texture_make(&d->texture, 1, 1);
        if (!status)
            texture_set(&d->texture, 0, 0, (float[3]){0.3f, 0.3f, 0.3f});
        return status;
    }
    return paint(&d->texture, kind, spot.width, spot.height, kind == PAINTING_RUG ? 0.006 : 0.0034, seed);
}

static enum status light_lamps(struct world_scene *s)
{
    enum status status = OK;
    for (int i = 0; i < LAMP_COUNT && !status; i++) {
        struct vec3 size = v3_sub(scene_lamps[i].high, scene_lamps[i].low);
        struct vec3 middle = v3_mix(scene_lamps[i].low, scene_lamps[i].high, 0.5);
        struct decal *d = add_decal(
            s, (struct decal_spot){SIDE_CEILING, middle.x + ROOM_HALF_X, ROOM_HALF_Y - middle.y, size.x, size.y, 0});
        d->glow = 2.4f;
        status = texture_make(&d->texture, 1, 1);
        if (!status)
            texture_set(&d->texture, 0, 0, (float[3]){0.95f, 0.93f, 0.88f});
    }
    return status;
}

static enum status add_posters(struct world_scene *s, uint32_t seed)
{
    static const struct {
        struct decal_spot at;
        enum painting kind;
    } spots[] = {
        {{SIDE_BACK, 0.75, 1.72, 0.60, 0.84, 0}, PAINTING_LANDSCAPE},
        {{SIDE_BACK, 1.55, 1.88, 0.50, 0.50, -1}, PAINTING_CIRCLES},
        {{SIDE_BACK, 2.72, 1.62, 0.70, 0.98, 0}, PAINTING_WORDS},
        {{SIDE_BACK, 3.55, 1.45, 0.55, 0.75, 1}, PAINTING_STRIPES},
        {{SIDE_BACK, 4.28, 2.12, 0.62, 0.44, 0}, PAINTING_MAP},
        {{SIDE_BACK, 6.10, 1.75, 0.50, 0.70, 0}, PAINTING_NIGHT},
        {{SIDE_BACK, 3.50, 2.15, 0.44, 0.32, 0}, PAINTING_LANDSCAPE},
        {{SIDE_LEFT, 1.55, 1.55, 1.30, 1.20, 0}, PAINTING_WINDOW},
        {{SIDE_LEFT, 3.75, 1.72, 0.60, 0.84, 0}, PAINTING_NIGHT},
        {{SIDE_LEFT, 4.50, 1.60, 0.50, 0.50, 2}, PAINTING_STRIPES},
        {{SIDE_LEFT, 5.90, 1.60, 0.76, 0.58, 0}, PAINTING_MAP},
        {{SIDE_LEFT, 6.70, 1.55, 0.48, 0.66, 0}, PAINTING_WORDS},
        {{SIDE_RIGHT, 0.80, 1.65, 0.62, 0.86, 0}, PAINTING_CIRCLES},
        {{SIDE_RIGHT, 1.75, 1.65, 0.80, 0.60, 0}, PAINTING_LANDSCAPE},
        {{SIDE_RIGHT, 3.55, 1.60, 0.58, 0.82, -1}, PAINTING_WORDS},
        {{SIDE_RIGHT, 4.25, 1.85, 0.46, 0.46, 0}, PAINTING_NIGHT},
        {{SIDE_RIGHT, 5.60, 1.72, 0.60, 0.80, 0}, PAINTING_MAP},
        {{SIDE_RIGHT, 6.50, 1.60, 0.64, 0.46, 1}, PAINTING_STRIPES},
        {{SIDE_REAR, 1.10, 1.05, 1.00, 2.10, 0}, PAINTING_DOOR},
        {{SIDE_REAR, 2.20, 1.65, 0.56, 0.78, 0}, PAINTING_STRIPES},
        {{SIDE_REAR, 3.80, 1.70, 0.90, 0.64, 0}, PAINTING_MAP},
        {{SIDE_REAR, 5.80, 1.65, 0.60, 0.84, 0}, PAINTING_LANDSCAPE},
        {{SIDE_FLOOR, 3.35, 3.45, 2.60, 1.90, 6}, PAINTING_RUG},
    };
    enum status status = OK;
    for (size_t i = 0; i < COUNT_OF(spots) && !status; i++)
        status = add_painting(s, spots[i].at, spots[i].kind, hash_of(seed, (uint32_t)i, 77) % 100000);
    return status;
}

static enum status add_furniture(struct world_scene *s, uint32_t seed)
{
    int shelf = add_box(s, v3(1.85, 3.28, 0), v3(2.75, 3.6, 1.95), MATERIAL_WOOD, 0x8a6642);
    add_box(s, v3(-2.75, 3.05, 0), v3(-1.75, 3.6, 0.52), MATERIAL_WOOD, 0xa5713f); // chest
    add_box(s, v3(-2.55, 3.15, 0.52), v3(-2.15, 3.5, 0.78), MATERIAL_CARDBOARD, 0xb08d62);
    add_box(s, v3(-3.2, 2.0, 0), v3(-2.68, 2.55, 0.50), MATERIAL_CARDBOARD, 0xb08d62);
    add_box(s, v3(-3.1, 2.1, 0.50), v3(-2.74, 2.42, 0.78), MATERIAL_CARDBOARD, 0xa9855a);
    // A table by the right wall, and the things on it.
    add_box(s, v3(2.62, 0.55, 0.71), v3(3.26, 2.05, 0.75), MATERIAL_WOOD, 0xc79a63);
    for (int i = 0; i < 4; i++) {
        double x = i & 1 ? 3.17 : 2.66, y = i & 2 ? 1.96 : 0.59;
        add_box(s, v3(x, y, 0), v3(x + 0.05, y + 0.05, 0.71), MATERIAL_WOOD, 0xb5844c);
    }
    add_box(s, v3(2.85, 1.45, 0.75), v3(3.15, 1.80, 0.97), MATERIAL_PAINT, 0xc8553d);
    add_box(s, v3(2.80, 0.85, 0.75), v3(3.10, 1.08, 0.81), MATERIAL_PAINT, 0x3d5a80);
    add_box(s, v3(2.83, 0.88, 0.81), v3(3.06, 1.05, 0.86), MATERIAL_PAINT, 0xe9c46a);
    int sideboard = add_box(s, v3(-3.3, -2.75, 0), v3(-2.88, -1.30, 0.74), MATERIAL_PAINT, 0x3c7a80);
    add_box(s, v3(-3.18, -2.45, 0.74), v3(-2.98, -2.25, 1.02), MATERIAL_PAINT, 0xe0b04a);
    add_box(s, v3(-3.2, -1.85, 0.74), v3(-2.95, -1.55, 0.86), MATERIAL_PAINT, 0xd9d2c5);
    add_box(s, v3(2.55, -2.9, 0), v3(3.05, -2.4, 0.46), MATERIAL_PAINT, 0xd98f4e); // a pouffe
    add_box(s, v3(2.95, -1.7, 0), v3(3.3, -0.9, 0.80), MATERIAL_WOOD, 0x9a7248);
    add_box(s, v3(1.25, 2.85, 0), v3(1.62, 3.22, 0.42), MATERIAL_PAINT, 0x8f3b4c);

    enum status status = add_painting(
        s, (struct decal_spot){s->boxes[shelf].first_surface + 2, 0.45, 0.975, 0.86, 1.90, 0}, PAINTING_BOOKS, seed);
    if (!status)
        status = add_painting(s, (struct decal_spot){s->boxes[sideboard].first_surface + 1, 0.725, 0.37, 1.43, 0.70, 0},
                              PAINTING_DRAWERS, seed);
    return status;
}

enum status scene_build(struct world_scene *s, const struct world_options *options)
{
    memset(s, 0, sizeof *s);
    const bool plain = s->plain = options->plain;
    uint32_t mixed = hash_of((uint32_t)options->seed, (uint32_t)(options->seed >> 32), 1);
    add_room(s);
    enum status status = options->bare ? OK : add_posters(s, mixed);
    if (!status)
        status = light_lamps(s);
    if (!status)
        status = add_furniture(s, mixed);
    if (!status && options->table)
        add_box(s, v3(1.0, -0.7, 0), v3(1.6, 0.7, 0.75), MATERIAL_WOOD, 0xc79a63);
    for (int i = 0; i < options->boxes && !status; i++)
        add_box(s, options->box[i].low, options->box[i].high, MATERIAL_WOOD, 0xa9855a);
    if (!status)
        status = add_tags(s, options->tags, &options->moved);
    if (!status && !plain)
        status = paint_grain(&s->grain, mixed);
    if (!status && !plain)
        status = paint_plaster(&s->plaster, mixed + 1);
    if (!status)
        status = scene_bake(s);
    if (status)
        scene_free(s);
    return status;
}

void scene_free(struct world_scene *s)
{
    for (int i = 0; i < s->decal_count; i++)
        texture_free(&s->decals[i].texture);
    for (int i = 0; i < s->surface_count; i++)
        free(s->surfaces[i].light);
    texture_free(&s->grain);
    texture_free(&s->plaster);
    memset(s, 0, sizeof *s);
}

// Where the ray enters a box: distance, and the face in add_box's order; -1: it misses.
static int box_entry(const struct room_box *b, struct vec3 from, struct vec3 inverse, double *distance)
{
    double x0 = (b->low.x - from.x) * inverse.x, x1 = (b->high.x - from.x) * inverse.x;
    double y0 = (b->low.y - from.y) * inverse.y, y1 = (b->high.y - from.y) * inverse.y;
    double z0 = (b->low.z - from.z) * inverse.z, z1 = (b->high.z - from.z) * inverse.z;
    double xn = x0 < x1 ? x0 : x1, xf = x0 < x1 ? x1 : x0;
    double yn = y0 < y1 ? y0 : y1, yf = y0 < y1 ? y1 : y0;
    double zn = z0 < z1 ? z0 : z1, zf = z0 < z1 ? z1 : z0;
    double entry = xn > yn ? xn : yn, far = xf < yf ? xf : yf;
    entry = entry > zn ? entry : zn;
    far = far < zf ? far : zf;
    if (!(entry < far) || entry <= 0)
        return -1;
    *distance = entry;
    return entry == xn ? (inverse.x > 0 ? 0 : 1) : entry == yn ? (inverse.y > 0 ? 2 : 3) : inverse.z > 0 ? 4 : 5;
}

static struct vec3 inverse_of(struct vec3 d)
{
    // a tiny number in place of zero: its inverse stays finite and its sign counts
    return v3(1 / (fabs(d.x) > 1e-12 ? d.x : 1e-12), 1 / (fabs(d.y) > 1e-12 ? d.y : 1e-12),
              1 / (fabs(d.z) > 1e-12 ? d.z : 1e-12));
}

struct hit scene_hit(const struct world_scene *s, struct vec3 from, struct vec3 direction, uint32_t boxes)
{
    struct vec3 inv = inverse_of(direction);
    double x = ((inv.x > 0 ? ROOM_HALF_X : -ROOM_HALF_X) - from.x) * inv.x;
    double y = ((inv.y > 0 ? ROOM_HALF_Y : -ROOM_HALF_Y) - from.y) * inv.y;
    double z = ((inv.z > 0 ? ROOM_HEIGHT : 0) - from.z) * inv.z;
    struct hit h = {z, inv.z > 0 ? SIDE_CEILING : SIDE_FLOOR, 0, 0};
    if (x < h.distance)
        h.distance = x, h.surface = inv.x > 0 ? SIDE_RIGHT : SIDE_LEFT;
    if (y < h.distance)
        h.distance = y, h.surface = inv.y > 0 ? SIDE_BACK : SIDE_REAR;
    for (; boxes; boxes &= boxes - 1) {
        int i = __builtin_ctz(boxes);
        double d;
        int face = i < s->box_count ? box_entry(&s->boxes[i], from, inv, &d) : -1;
        if (face >= 0 && d < h.distance)
            h.distance = d, h.surface = s->boxes[i].first_surface + face;
    }
    const struct room_surface *f = &s->surfaces[h.surface];
    struct vec3 at = v3_sub(v3_add(from, v3_scale(direction, h.distance)), f->corner);
    h.u = v3_dot(at, f->u);
    h.v = v3_dot(at, f->v);
    return h;
}

bool scene_blocked(const struct world_scene *s, struct vec3 from, struct vec3 to)
{
    struct vec3 inv = inverse_of(v3_sub(to, from));
    for (int i = 0; i < s->box_count; i++) {
        double d;
        if (box_entry(&s->boxes[i], from, inv, &d) >= 0 && d > 1e-6 && d < 1)
            return true;
    }
    return false;
}

int scene_decal(const struct world_scene *s, int surface, double u, double v)
{
    for (uint64_t left = s->surfaces[surface].decals; left;) {
        const int i = 63 - __builtin_clzll(left);
        const struct decal *d = &s->decals[i];
        left &= ~(1ULL << i);
        double du = u - d->u, dv = v - d->v;
        if (fabs(du * d->cosine + dv * d->sine) < d->width / 2 && fabs(dv * d->cosine - du * d->sine) < d->height / 2)
            return i;
    }
    return -1;
}

// The share of [x - w/2, x + w/2] that lies within half a line of a multiple of `period`.
static float lines(double x, double period, double line, double w)
{
    w = most(w, 1e-4);
    double low = (x - w / 2) / period, high = (x + w / 2) / period, share = line / period;
    // the integral of the pulse train, shifted so that pulses start at whole numbers
    low += share / 2, high += share / 2;
    const double i = floor_int(low), j = floor_int(high);
    double a = i * share + least(low - i, share), b = j * share + least(high - j, share);
    return (float)((b - a) / (high - low));
}

static void tile(const struct texture *t, double u, double v, double texel_m, struct footprint f, float out[3])
{
    float s = (float)(1 / texel_m);
    const struct texture_footprint foot = {f.dudx * s, f.dvdx * s, f.dudy * s, f.dvdy * s};
    texture_at(t, u * (double)s, v * (double)s, &foot, true, out);
}

// Planks 15 cm wide and 1.5 m long, each with its own tint and grain offset.
static void floor_albedo(const struct world_scene *s, const struct room_surface *f, double u, double v,
                         struct footprint foot, float albedo[3])
{
    const double width = 0.15, length = 1.5;
    double row = floor(u / width), shift = (double)hash_unit((uint32_t)(int)row, 5, 9) * length;
    double plank = floor((v + shift) / length);
    uint32_t id = hash_of((uint32_t)(int)row, (uint32_t)(int)plank, 3);
    float grain[3] = {0.5f, 0.5f, 0.5f};
    if (!s->plain) // the grain runs along v
        tile(&s->grain, v + 0.01 * (id % 997), u + 0.01 * (id % 89), 0.0022,
             (struct footprint){foot.dvdx, foot.dudx, foot.dvdy, foot.dudy}, grain);
    double wu = fabs((double)foot.dudx) + fabs((double)foot.dudy),
           wv = fabs((double)foot.dvdx) + fabs((double)foot.dvdy);
    float gap = lines(u, width, 0.004, wu) + lines(v + shift, length, 0.004, wv);
    float tone = (0.72f + 0.50f * hash_unit(id, 1, 1)) * (1 - 0.75f * minf(1, gap));
    float warm = 0.06f * (hash_unit(id, 2, 2) - 0.5f);
    for (int c = 0; c < 3; c++)
        albedo[c] = f->tint[c] * tone * 2 * grain[c] * (1 + warm * (float)(1 - c));
}

static void wall_albedo(const struct world_scene *s, const struct room_surface *f, double u, double v,
                        struct footprint foot, float albedo[3])
{
    float plaster[3] = {0.5f, 0.5f, 0.5f};
    if (!s->plain)
        tile(&s->plaster, u, v, 0.004, foot, plaster);
    static const float dado[3] = {0.20f, 0.30f, 0.27f}, rail[3] = {0.62f, 0.58f, 0.50f},
                       skirting[3] = {0.58f, 0.54f, 0.47f};
    // From the floor up: skirting board, painted dado, rail, wall; edges as wide as a sample.
    static const double ends[] = {0.09, 0.095, 0.88, 0.885, 0.925, 0.93};
    const float *bands[] = {skirting, NULL, dado, NULL, rail, NULL, f->tint};
    double w = most(1e-4, fabs((double)foot.dvdx) + fabs((double)foot.dvdy)), low = v - w / 2, high = v + w / 2,
           from = low;
    albedo[0] = albedo[1] = albedo[2] = 0;
    for (int i = 0; i <= 6; i++) {
        double to = i < 6 ? least(high, ends[i]) : high;
        if (to > from) {
            for (int c = 0; c < 3; c++)
                albedo[c] += (float)((to - from) / w) * (bands[i] ? bands[i][c] : 0.12f);
            from = to;
        }
    }
    for (int c = 0; c < 3; c++)
        albedo[c] *= 2 * plaster[c];
}

float scene_albedo(const struct world_scene *s, struct surface_point at, struct footprint foot, float albedo[3])
{
    const int surface = at.surface, decal = at.decal;
    const double u = at.u, v = at.v;
    const struct room_surface *f = &s->surfaces[surface];
    if (decal >= 0) {
        const struct decal *d = &s->decals[decal];
        double du = u - d->u, dv = v - d->v;
        double x = du * d->cosine + dv * d->sine + d->width / 2, y = dv * d->cosine - du * d->sine + d->height / 2;
        double sx = d->texture.width[0] / d->width, sy = d->texture.height[0] / d->height;
        float c = (float)d->cosine, n = (float)d->sine, fx = (float)sx, fy = (float)sy;
        const struct texture_footprint on_decal = {
            (foot.dudx * c + foot.dvdx * n) * fx, (foot.dvdx * c - foot.dudx * n) * fy,
            (foot.dudy * c + foot.dvdy * n) * fx, (foot.dvdy * c - foot.dudy * n) * fy};
        texture_at(&d->texture, x * sx, y * sy, &on_decal, false, albedo);
        return d->glow;
    }
    float texel[3] = {0.5f, 0.5f, 0.5f};
    switch (f->material) {
    case MATERIAL_FLOOR: floor_albedo(s, f, u, v, foot, albedo); return 0;
    case MATERIAL_WALL: wall_albedo(s, f, u, v, foot, albedo); return 0;
    case MATERIAL_WOOD:
        if (!s->plain)
            tile(&s->grain, u + 0.37 * surface, v, 0.0025, foot, texel);
        break;
    case MATERIAL_CARDBOARD: {
        if (!s->plain)
            tile(&s->plaster, u + 0.11 * surface, v, 0.002, foot, texel);
        double w = fabs((double)foot.dudx) + fabs((double)foot.dudy);
        float tape = lines(u - f->width / 2, 10, 0.05, w);
        for (int c = 0; c < 3; c++)
            texel[c] *= 1 + tape * (0.35f - 0.1f * (float)c);
        break;
    }
    case MATERIAL_CEILING:
    case MATERIAL_PAINT:
        if (!s->plain)
            tile(&s->plaster, u, v, 0.004, foot, texel);
        break;
    }
    for (int c = 0; c < 3; c++)
        albedo[c] = f->tint[c] * 2 * texel[c];
    return 0;
}
