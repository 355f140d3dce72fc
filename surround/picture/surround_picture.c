#include "surround/picture/surround_picture.h"

#include "base/clamp.h"
#include "base/memory.h"
#include "base/portable_math.h"
#include "surround/picture/picture_lanes.h"

#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- surround mesh free

// Freeing a mesh, apart from making it, which stands on pictures.

void surround_mesh_free(struct surround_mesh *mesh)
{
    for (int i = 0; i < mesh->count; i++) {
        free(mesh->pieces[i].vertices);
        free(mesh->pieces[i].indices);
    }
    free(mesh->pieces);
    *mesh = (struct surround_mesh){0};
}

void surround_picture_free_mesh(struct surround_picture *picture)
{
    if (picture->mesh)
        surround_mesh_free(picture->mesh);
    free(picture->mesh);
    picture->mesh = NULL;
}

// ---------------------------------------------------------------- surround mesh

enum { BLOCK = 16, MAX_VERTICES = 65536, GRID = 5 };
// A piece is at most this wide and high, radians: between the rays of its grid it bulges by at most 4 %.
#define PIECE_RAD 0.8f
#define INFINITE  1e30f
_Static_assert(GRID *GRID == SURROUND_MESH_RAYS, "a square grid");

// The lattice of vertices: pixel centres, a panorama's first column again after its last, and beyond the picture as
// much as whole blocks need.
struct maker {
    const struct surround_picture *p;
    float tolerance;
    int cells_across, cells_down; // of the picture
    int columns, rows;            // of the lattice
    float *error;                 // of each vertex as the middle of a longest side: infinite where it must be there
    int32_t *number;              // of each vertex in the piece under way; -1: not in it
    struct surround_mesh *mesh;
    // The piece under way
    float (*vertices)[4];
    int32_t *members; // lattice vertices with numbers
    uint16_t *indices;
    int vertex_count, member_count, index_count;
    bool full;
};

struct node {
    int x, y;
};

static int picture_column(const struct maker *maker, int x) { return x < maker->p->width ? x : x - maker->p->width; }

static float inverse_at(const struct maker *maker, int x, int y)
{
    return maker->p->inverse[(size_t)y * (size_t)maker->p->width + (size_t)picture_column(maker, x)];
}

static bool is_inside(const struct maker *maker, int x, int y)
{
    return x <= maker->cells_across && y <= maker->cells_down;
}

static bool is_joined(const struct maker *maker, int x, int y)
{
    return x < maker->cells_across && y < maker->cells_down &&
           maker->p->joined[(size_t)y * (size_t)maker->p->width + (size_t)x] & JOINED_DIAGONAL;
}

static float *error_at(struct maker *maker, int x, int y)
{
    return &maker->error[(size_t)y * (size_t)maker->columns + (size_t)x];
}

static void raise_error(float *error, float value) { *error = value > *error ? value : *error; }

// How far the middle of the side a-b is from it, as a share. On a plane the inverse distance is linear in the ray, and
// the sum of the ends' rays is the middle's times that of their parts along it.
static float side_error(const struct maker *maker, struct node a, struct node b)
{
    const int x = (a.x + b.x) / 2, y = (a.y + b.y) / 2;
    float ends[2][3], middle[3], along = 0;
    if (!is_inside(maker, a.x, a.y) || !is_inside(maker, b.x, b.y))
        return INFINITE;
    surround_picture_ray(maker->p, picture_column(maker, a.x), a.y, ends[0]);
    surround_picture_ray(maker->p, picture_column(maker, b.x), b.y, ends[1]);
    surround_picture_ray(maker->p, picture_column(maker, x), y, middle);
    for (int i = 0; i < 3; i++)
        along += middle[i] * (ends[0][i] + ends[1][i]);
    const float there = inverse_at(maker, x, y),
                line = (inverse_at(maker, a.x, a.y) + inverse_at(maker, b.x, b.y)) / along;
    return fabsf(there - line) / (there + 1e-4f);
}

// Corners of cells that are cut or beyond the picture are vertices.
static void mark_cut(struct maker *maker)
{
    for (int y = 0; y + 1 < maker->rows; y++)
        for (int x = 0; x + 1 < maker->columns; x++)
            if (!is_joined(maker, x, y))
                for (int k = 0; k < 4; k++)
                    *error_at(maker, x + (k & 1), y + (k >> 1)) = INFINITE;
}

// The diagonals of squares of one size form a lattice of diamonds.
static bool has_falling_diagonal(int x, int y, int size) { return (x / size + y / size) % 2 == 0; }

// From small triangles to large, so that a vertex of a small one entails those of the large ones that it is in.
static void measure_errors(struct maker *maker)
{
    for (int s = 2; s <= BLOCK; s *= 2) {
        const int h = s / 2, q = s / 4;
        for (int y = 0; y < maker->rows; y += h)
            for (int x = y % s ? 0 : h; x < maker->columns; x += s) {
                const struct node a = {y % s ? x : x - h, y % s ? y - h : y},
                                  b = {y % s ? x : x + h, y % s ? y + h : y};
                float *error = error_at(maker, x, y);
                if (*error < INFINITE)
                    raise_error(error, side_error(maker, a, b));
                for (int k = 0; k < 4 && q; k++) {
                    const int cx = x + (k & 1 ? q : -q), cy = y + (k & 2 ? q : -q);
                    if (cx >= 0 && cy >= 0 && cx < maker->columns && cy < maker->rows)
                        raise_error(error, *error_at(maker, cx, cy));
                }
            }
        for (int y = 0; y + s < maker->rows; y += s)
            for (int x = 0; x + s < maker->columns; x += s) {
                const bool down = has_falling_diagonal(x, y, s);
                const struct node a = {x, down ? y : y + s}, b = {x + s, down ? y + s : y};
                float *error = error_at(maker, x + h, y + h);
                if (*error < INFINITE)
                    raise_error(error, side_error(maker, a, b));
                raise_error(error, *error_at(maker, x + h, y));
                raise_error(error, *error_at(maker, x + h, y + s));
                raise_error(error, *error_at(maker, x, y + h));
                raise_error(error, *error_at(maker, x + s, y + h));
            }
    }
}

// ---------------------------------------------------------------- triangles

static int add_vertex(struct maker *maker, const float ray[3], float inverse)
{
    if (maker->vertex_count == MAX_VERTICES) {
        maker->full = true;
        return 0;
    }
    float *v = maker->vertices[maker->vertex_count];
    memcpy(v, ray, 3 * sizeof *v);
    v[3] = inverse;
    return maker->vertex_count++;
}

static int vertex_number(struct maker *maker, struct node node)
{
    const size_t at = (size_t)node.y * (size_t)maker->columns + (size_t)node.x;
    float ray[3];
    if (maker->number[at] >= 0)
        return maker->number[at];
    if (maker->vertex_count == MAX_VERTICES)
        maker->full = true;
    if (maker->full)
        return 0;
    surround_picture_ray(maker->p, picture_column(maker, node.x), node.y, ray);
    maker->number[at] = add_vertex(maker, ray, inverse_at(maker, node.x, node.y));
    maker->members[maker->member_count++] = (int32_t)at;
    return maker->number[at];
}

static void add_triangle(struct maker *maker, int a, int b, int c)
{
    if (maker->full)
        return;
    maker->indices[maker->index_count++] = (uint16_t)a;
    maker->indices[maker->index_count++] = (uint16_t)b;
    maker->indices[maker->index_count++] = (uint16_t)c;
}

static int least_of(int a, int b, int c)
{
    const int least = a < b ? a : b;
    return least < c ? least : c;
}

// a-b is the longest side; counter-clockwise in the picture.
static void add_triangles(struct maker *maker, struct node a, struct node b, struct node c)
{
    const bool finest = (a.x + b.x) % 2 != 0;
    const struct node middle = {(a.x + b.x) / 2, (a.y + b.y) / 2};
    if (!finest && *error_at(maker, middle.x, middle.y) > maker->tolerance) {
        add_triangles(maker, c, a, middle);
        add_triangles(maker, b, c, middle);
    } else if (!finest || is_joined(maker, least_of(a.x, b.x, c.x), least_of(a.y, b.y, c.y)))
        add_triangle(maker, vertex_number(maker, a), vertex_number(maker, b), vertex_number(maker, c));
}

// A rectangle of a pixel's surroundings, half a pixel to each side at most, all as far as the pixel.
static void add_patch(struct maker *maker, struct node at, float rays[3][3][3], const int low[2], const int high[2])
{
    const float inverse = inverse_at(maker, at.x, at.y);
    int corner[4];
    for (int c = 0; c < 4; c++)
        corner[c] = add_vertex(maker, rays[1 + (c & 2 ? high[1] : low[1])][1 + (c & 1 ? high[0] : low[0])], inverse);
    add_triangle(maker, corner[0], corner[2], corner[1]);
    add_triangle(maker, corner[1], corner[2], corner[3]);
}

// The rays of a pixel's corners, sides and middle: half way to its neighbours, of which there may be none.
static void corner_rays(const struct maker *maker, struct node at, float rays[3][3][3])
{
    float to[3][3][3];
    for (int k = 0; k < 9; k++) {
        int x = at.x + k % 3 - 1;
        const int y = at.y + k / 3 - 1;
        x = maker->p->panorama && x < 0 ? x + maker->p->width : x;
        const bool there = x >= 0 && y >= 0 && is_inside(maker, x, y);
        surround_picture_ray(maker->p, picture_column(maker, there ? x : at.x), there ? y : at.y, to[k / 3][k % 3]);
    }
    for (int j = 0; j < 3; j++)
        for (int i = 0; i < 3; i++)
            for (int c = 0; c < 3; c++)
                rays[j][i][c] = to[1][1][c] + 0.5f * (to[1][i][c] - to[1][1][c]) + 0.5f * (to[j][1][c] - to[1][1][c]);
}

// Where four pixels are not one surface, each that is known covers its own quarter between their centres: the quarters
// of one pixel, together where they make a rectangle. A panorama's first column is there twice, with the quarters of
// one side each.
static void add_quarters(struct maker *maker, struct node at)
{
    static const int sides[2][2] = {{-1, 0}, {0, 1}}, both[2] = {-1, 1};
    bool cut[4]; // the cells left above, right above, left below, right below
    float rays[3][3][3];
    for (int k = 0; k < 4; k++) {
        const int x = at.x - 1 + (k & 1), y = at.y - 1 + (k >> 1);
        cut[k] = x >= 0 && y >= 0 && x < maker->cells_across && y < maker->cells_down && !is_joined(maker, x, y);
    }
    if (!(cut[0] | cut[1] | cut[2] | cut[3]) || inverse_at(maker, at.x, at.y) < 0)
        return;
    corner_rays(maker, at, rays);
    if (cut[0] & cut[1] & cut[2] & cut[3]) {
        add_patch(maker, at, rays, (int[2]){-1, -1}, (int[2]){1, 1});
        return;
    }
    const bool upright = (cut[0] & cut[2]) | (cut[1] & cut[3]);
    for (int s = 0; s < 2; s++) { // columns, or rows, of quarters
        const bool a = cut[upright ? s : 2 * s], b = cut[upright ? s + 2 : 2 * s + 1];
        const int *half = sides[s], *span = a && b ? both : sides[b];
        const int *across = upright ? half : span, *down = upright ? span : half;
        if (a || b)
            add_patch(maker, at, rays, (int[2]){across[0], down[0]}, (int[2]){across[1], down[1]});
    }
}

// ---------------------------------------------------------------- pieces

static void set_bounds(const struct maker *maker, struct surround_mesh_piece *piece, struct node low, struct node high)
{
    const int right = high.x < maker->cells_across ? high.x : maker->cells_across;
    const int bottom = high.y < maker->cells_down ? high.y : maker->cells_down;
    for (int k = 0; k < SURROUND_MESH_RAYS; k++) {
        const int x = low.x + (right - low.x) * (k % GRID) / (GRID - 1);
        const int y = low.y + (bottom - low.y) * (k / GRID) / (GRID - 1);
        surround_picture_ray(maker->p, picture_column(maker, x), y, piece->rays[k]);
    }
    piece->least = INFINITE;
    piece->most = 0;
    for (int i = 0; i < piece->vertex_count; i++) {
        piece->least = fminf(piece->least, piece->vertices[i][3]);
        piece->most = fmaxf(piece->most, piece->vertices[i][3]);
    }
}

static enum status keep_piece(struct maker *maker, struct node low, struct node high)
{
    struct surround_mesh_piece *pieces =
        realloc(maker->mesh->pieces, sizeof *pieces * ((size_t)maker->mesh->count + 1));
    if (!pieces)
        return fail(ERR_MEMORY, "no memory for a picture's mesh");
    maker->mesh->pieces = pieces;
    struct surround_mesh_piece *piece = &pieces[maker->mesh->count++];
    *piece = (struct surround_mesh_piece){.vertices = malloc(sizeof *piece->vertices * (size_t)maker->vertex_count),
                                          .indices = malloc(sizeof *piece->indices * (size_t)maker->index_count),
                                          .vertex_count = maker->vertex_count,
                                          .index_count = maker->index_count};
    if (!piece->vertices || !piece->indices)
        return fail(ERR_MEMORY, "no memory for a picture's mesh");
    memcpy(piece->vertices, maker->vertices, sizeof *piece->vertices * (size_t)maker->vertex_count);
    memcpy(piece->indices, maker->indices, sizeof *piece->indices * (size_t)maker->index_count);
    set_bounds(maker, piece, low, high);
    return OK;
}

static void fill_piece(struct maker *maker, struct node low, struct node high)
{
    maker->vertex_count = maker->index_count = maker->member_count = 0;
    maker->full = false;
    for (int y = low.y; y < high.y; y += BLOCK)
        for (int x = low.x; x < high.x; x += BLOCK) {
            const struct node tl = {x, y}, tr = {x + BLOCK, y}, bl = {x, y + BLOCK}, br = {x + BLOCK, y + BLOCK};
            if (has_falling_diagonal(x, y, BLOCK)) {
                add_triangles(maker, br, tl, bl);
                add_triangles(maker, tl, br, tr);
            } else {
                add_triangles(maker, tr, bl, br);
                add_triangles(maker, bl, tr, tl);
            }
        }
    // The last column and row of pixels belong to the last pieces
    const int right = high.x >= maker->cells_across ? maker->cells_across : high.x - 1;
    const int bottom = high.y >= maker->cells_down ? maker->cells_down : high.y - 1;
    for (int y = low.y; y <= bottom; y++)
        for (int x = low.x; x <= right; x++)
            add_quarters(maker, (struct node){x, y});
    for (int i = 0; i < maker->member_count; i++)
        maker->number[maker->members[i]] = -1;
}

// What has too many vertices is made in four.
static enum status make_piece(struct maker *maker, struct node low, int size)
{
    const struct node high = {low.x + size < maker->columns ? low.x + size : maker->columns - 1,
                              low.y + size < maker->rows ? low.y + size : maker->rows - 1};
    if (low.x >= high.x || low.y >= high.y)
        return OK;
    fill_piece(maker, low, high);
    if (!maker->full)
        return maker->index_count ? keep_piece(maker, low, high) : OK;
    assert(size > BLOCK); // whose vertices fit
    enum status status = OK;
    for (int k = 0; k < 4 && status == OK; k++)
        status = make_piece(maker, (struct node){low.x + (k & 1) * size / 2, low.y + (k >> 1) * size / 2}, size / 2);
    return status;
}

static float pixel_angle(const struct surround_picture *picture)
{
    return picture->panorama ? 6.2831853f / (float)picture->width : (float)(1 / picture->lens.fx);
}

float surround_mesh_tolerance(const struct surround_picture *picture) { return pixel_angle(picture); }

static enum status open_maker(struct maker *maker)
{
    const struct surround_picture *p = maker->p;
    maker->cells_across = p->panorama ? p->width : p->width - 1;
    maker->cells_down = p->height - 1;
    maker->columns = (maker->cells_across + BLOCK - 1) / BLOCK * BLOCK + 1;
    maker->rows = (maker->cells_down + BLOCK - 1) / BLOCK * BLOCK + 1;
    const size_t count = (size_t)maker->columns * (size_t)maker->rows;
    maker->error = calloc(count, sizeof *maker->error);
    maker->number = malloc(count * sizeof *maker->number);
    maker->vertices = malloc(MAX_VERTICES * sizeof *maker->vertices);
    maker->members = malloc(MAX_VERTICES * sizeof *maker->members);
    // Each vertex of the lattice has two triangles; a quarter's four have two.
    maker->indices = malloc(3 * 2 * MAX_VERTICES * sizeof *maker->indices);
    if (!maker->error || !maker->number || !maker->vertices || !maker->members || !maker->indices)
        return fail(ERR_MEMORY, "no memory for a picture's mesh");
    for (size_t i = 0; i < count; i++)
        maker->number[i] = -1;
    return OK;
}

enum status surround_mesh_make(struct surround_mesh *mesh, const struct surround_picture *picture, float tolerance)
{
    struct maker m = {.p = picture, .tolerance = tolerance, .mesh = mesh};
    *mesh = (struct surround_mesh){0};
    int size = BLOCK;
    while ((float)(2 * size) * pixel_angle(picture) <= PIECE_RAD)
        size *= 2;
    enum status status = open_maker(&m);
    if (status == OK) {
        mark_cut(&m);
        measure_errors(&m);
    }
    for (int y = 0; y < m.rows - 1 && status == OK; y += size)
        for (int x = 0; x < m.columns - 1 && status == OK; x += size)
            status = make_piece(&m, (struct node){x, y}, size);
    free(m.error);
    free(m.number);
    free(m.vertices);
    free(m.members);
    free(m.indices);
    if (status != OK)
        surround_mesh_free(mesh);
    return status;
}

enum status surround_picture_make_mesh(struct surround_picture *picture)
{
    surround_picture_free_mesh(picture);
    picture->mesh = calloc(1, sizeof *picture->mesh);
    const enum status status = picture->mesh
                                   ? surround_mesh_make(picture->mesh, picture, surround_mesh_tolerance(picture))
                                   : fail(ERR_MEMORY, "no memory for a picture's mesh");
    if (status != OK)
        surround_picture_free_mesh(picture);
    return status;
}

// ---------------------------------------------------------------- surround picture

// Each of a vector's lower bytes, then one of another's.
#define ORDER_BYTES 0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23
#define PI          3.14159265358979323846

enum status surround_picture_make(struct surround_picture *picture, uint8_t *rgb, int width, int height,
                                  const struct lens *lens)
{
    *picture =
        (struct surround_picture){.panorama = !lens, .width = width, .height = height, .rgb = rgb, .gain = {1, 1, 1}};
    if (lens)
        picture->lens = *lens;
    picture->ray_table = malloc(sizeof *picture->ray_table * 2 * (size_t)(width + height));
    if (!picture->ray_table) {
        surround_picture_free(picture);
        return fail(ERR_MEMORY, "no memory for a picture of the surroundings");
    }
    for (int i = 0; i < width + height; i++) {
        const double angle = i < width ? (i + 0.5) / width * 2 * PI - PI : (i - width + 0.5) / height * PI;
        picture->ray_table[2 * i] = (float)portable_sin(angle);
        picture->ray_table[2 * i + 1] = (float)portable_cos(angle);
    }
    surround_picture_place(picture, POSE_IDENTITY);
    return OK;
}

enum status surround_image_undistort(uint8_t *rgb, struct lens *lens)
{
    const size_t w = (size_t)lens->width, bytes = w * (size_t)lens->height * 3;
    if (lens_is_ideal(lens))
        return OK;
    uint8_t *taken = malloc(bytes);
    if (!taken)
        return fail(ERR_MEMORY, "no memory for a picture of the surroundings");
    memcpy(taken, rgb, bytes);
    const double largest = lens_max_radius2(lens);
    for (int v = 0; v < lens->height; v++)
        for (int u = 0; u < lens->width; u++) {
            const struct vec3 ray = v3((u - lens->cx) / lens->fx, (v - lens->cy) / lens->fy, 1);
            const struct pixel at = lens_project_clamped(lens, largest, ray);
            const double x = fmax(0, fmin(lens->width - 1.001, at.x)), y = fmax(0, fmin(lens->height - 1.001, at.y));
            const uint8_t *p = taken + 3 * ((size_t)y * w + (size_t)x);
            const double fx = x - (int)x, fy = y - (int)y;
            for (size_t c = 0; c < 3; c++)
                rgb[3 * ((size_t)v * w + (size_t)u) + c] =
                    (uint8_t)((1 - fy) * ((1 - fx) * p[c] + fx * p[c + 3]) +
                              fy * ((1 - fx) * p[c + 3 * w] + fx * p[c + 3 * w + 3]) + 0.5);
        }
    free(taken);
    lens->k1 = lens->k2 = lens->p1 = lens->p2 = lens->k3 = 0;
    return OK;
}

void surround_picture_free(struct surround_picture *picture)
{
    free(picture->rgb);
    free(picture->inverse);
    free(picture->joined);
    surround_picture_free_mesh(picture);
    free(picture->ray_table);
    *picture = (struct surround_picture){0};
}

void surround_picture_place(struct surround_picture *picture, struct pose world_from_camera)
{
    picture->world_from_camera = world_from_camera;
    quat_to_matrix(world_from_camera.rotation, picture->axes);
}

void surround_picture_ray(const struct surround_picture *picture, int u, int v, float ray[3])
{
    if (picture->panorama) {
        const float *column = picture->ray_table + 2 * u, *row = picture->ray_table + 2 * (picture->width + v);
        ray[0] = row[0] * column[0];
        ray[1] = -row[1];
        ray[2] = row[0] * column[1];
        return;
    }
    const float x = (float)((u - picture->lens.cx) / picture->lens.fx),
                y = (float)((v - picture->lens.cy) / picture->lens.fy);
    const float scale = 1 / sqrtf(x * x + y * y + 1);
    ray[0] = x * scale;
    ray[1] = y * scale;
    ray[2] = scale;
}

void surround_picture_rays(const struct surround_picture *picture, int u, int v, four ray[3])
{
    if (picture->panorama) {
        const float *row = picture->ray_table + 2 * (picture->width + v);
        four a, b;
        memcpy(&a, picture->ray_table + 2 * u, sizeof a);
        memcpy(&b, picture->ray_table + 2 * u + 4, sizeof b);
        ray[0] = row[0] * __builtin_shufflevector(a, b, 0, 2, 4, 6);
        ray[1] = FOUR(-row[1]);
        ray[2] = row[0] * __builtin_shufflevector(a, b, 1, 3, 5, 7);
        return;
    }
    const four_doubles column = {u, u + 1, u + 2, u + 3};
    const four x = __builtin_convertvector((column - picture->lens.cx) / picture->lens.fx, four);
    const float y = (float)((v - picture->lens.cy) / picture->lens.fy);
    const four scale = 1 / four_sqrt(x * x + y * y + 1);
    ray[0] = x * scale;
    ray[1] = y * scale;
    ray[2] = scale;
}

// Its two steps, for who may do without the second: the point in camera axes and, returned, its distance; then u and v
// of a point in camera axes, with out->distance given.
static float surround_picture_distance(const struct surround_picture *picture, const double world[3], float camera[3])
{
    const struct vec3 *t = &picture->world_from_camera.translation;
    const double d[3] = {world[0] - t->x, world[1] - t->y, world[2] - t->z};
    for (int i = 0; i < 3; i++)
        camera[i] = (float)(picture->axes[0][i] * d[0] + picture->axes[1][i] * d[1] + picture->axes[2][i] * d[2]);
    return sqrtf(camera[0] * camera[0] + camera[2] * camera[2] + camera[1] * camera[1]);
}

static bool surround_picture_find(const struct surround_picture *picture, const float c[3], struct picture_point *out)
{
    if (picture->panorama) {
        const float flat2 = c[0] * c[0] + c[2] * c[2];
        const float w = (float)picture->width, h = (float)picture->height;
        out->u = (fast_atan2(c[0], c[2]) * (float)(1 / (2 * PI)) + 0.5f) * w - 0.5f;
        out->v = fast_atan2(sqrtf(flat2), -c[1]) * (float)(1 / PI) * h - 0.5f;
        if (out->u >= w - 0.5f)
            out->u -= w;
        return out->distance > 1e-6f;
    }
    if (c[2] < 1e-3f)
        return false;
    out->u = (float)(picture->lens.fx * (double)(c[0] / c[2]) + picture->lens.cx);
    out->v = (float)(picture->lens.fy * (double)(c[1] / c[2]) + picture->lens.cy);
    return out->u > -0.5f && out->v > -0.5f && out->u < (float)picture->width - 0.5f &&
           out->v < (float)picture->height - 0.5f;
}

bool surround_picture_project(const struct surround_picture *picture, const double world[3], struct picture_point *out)
{
    float camera[3];
    out->distance = surround_picture_distance(picture, world, camera);
    return surround_picture_find(picture, camera, out);
}

void surround_picture_distances(const struct surround_picture *picture, const four_doubles world[3], four camera[3],
                                struct four_points *out)
{
    const struct vec3 *t = &picture->world_from_camera.translation;
    const four_doubles d[3] = {world[0] - t->x, world[1] - t->y, world[2] - t->z};
    for (int i = 0; i < 3; i++) {
        const four_doubles sum = picture->axes[0][i] * d[0] + picture->axes[1][i] * d[1] + picture->axes[2][i] * d[2];
        camera[i] = __builtin_convertvector(sum, four);
    }
    out->distance = four_sqrt(camera[0] * camera[0] + camera[2] * camera[2] + camera[1] * camera[1]);
}

void surround_picture_find_four(const struct surround_picture *picture, const four c[3], struct four_points *out)
{
    const float w = (float)picture->width, h = (float)picture->height;
    if (picture->panorama) {
        const four flat = four_sqrt(c[0] * c[0] + c[2] * c[2]);
        const four u = (four_atan2(c[0], c[2]) * (float)(1 / (2 * PI)) + 0.5f) * w - 0.5f;
        out->u = FOUR_SELECT(u >= w - 0.5f, u - w, u);
        out->v = four_atan2(flat, -c[1]) * (float)(1 / PI) * h - 0.5f;
        out->inside = out->distance > 1e-6f;
        return;
    }
    const four_doubles x = __builtin_convertvector(c[0] / c[2], four_doubles);
    const four_doubles y = __builtin_convertvector(c[1] / c[2], four_doubles);
    out->u = __builtin_convertvector(picture->lens.fx * x + picture->lens.cx, four);
    out->v = __builtin_convertvector(picture->lens.fy * y + picture->lens.cy, four);
    out->inside = (c[2] >= 1e-3f) & (out->u > -0.5f) & (out->v > -0.5f) & (out->u < w - 0.5f) & (out->v < h - 0.5f);
}

static void catmull_rom(float t, float weight[4])
{
    weight[0] = ((-0.5f * t + 1) * t - 0.5f) * t;
    weight[1] = (1.5f * t - 2.5f) * t * t + 1;
    weight[2] = ((-1.5f * t + 2) * t + 0.5f) * t;
    weight[3] = (0.5f * t - 0.5f) * t * t;
}

static int column_of(const struct surround_picture *picture, int u)
{
    return clamp_int(surround_picture_column(picture, u), 0, picture->width - 1);
}

typedef uint8_t bytes16 __attribute__((vector_size(16)));
typedef uint16_t words8 __attribute__((vector_size(16)));

// Red, green and blue of a pixel as numbers; the fourth means nothing. Reads four bytes.
static four pixel_color(const uint8_t *rgb)
{
    uint32_t four_bytes;
    memcpy(&four_bytes, rgb, sizeof four_bytes);
    const bytes16 none = {0}, bytes = (bytes16)(four_ints){(int32_t)four_bytes};
    const words8 words = (words8)__builtin_shufflevector(bytes, none, ORDER_BYTES), no_words = {0};
    return __builtin_convertvector((four_ints)__builtin_shufflevector(words, no_words, 0, 8, 1, 9, 2, 10, 3, 11), four);
}

void surround_picture_sample(const struct surround_picture *picture, float u, float v, float rgb[3])
{
    const int x = floor_of(u), y = floor_of(v);
    const bool within = x >= 1 && x + 3 < picture->width; // and a pixel more, whose first byte is read
    float wx[4], wy[4];
    four sum = {0};
    catmull_rom(u - (float)x, wx);
    catmull_rom(v - (float)y, wy);
    for (int j = 0; j < 4; j++) {
        const int row = clamp_int(y + j - 1, 0, picture->height - 1);
        const uint8_t *from = picture->rgb + 3 * (size_t)row * (size_t)picture->width;
        four line = {0};
        for (int i = 0; i < 4; i++) {
            const int column = within ? x + i - 1 : column_of(picture, x + i - 1);
            const uint8_t *pixel = from + 3 * (size_t)column;
            line += wx[i] * (within ? pixel_color(pixel) : (four){pixel[0], pixel[1], pixel[2]});
        }
        sum += wy[j] * line;
    }
    for (int c = 0; c < 3; c++)
        rgb[c] = clamp_float(sum[c] * picture->gain[c], 0, 255);
}

// Whether b follows a on one surface: little apart, or on the line through what lies before a or after b.
static bool is_continuous(float before, float a, float b, float after)
{
    if (a < 0 || b < 0)
        return false;
    const float tolerance = 0.03f * (a > b ? a : b);
    return fabsf(b - a) <= tolerance || (before >= 0 && fabsf(2 * a - before - b) <= tolerance) ||
           (after >= 0 && fabsf(2 * b - after - a) <= tolerance);
}

void surround_picture_join(struct surround_picture *picture)
{
    const int w = picture->width, h = picture->height;
    for (int v = 0; v < h; v++)
        for (int u = 0; u < w; u++) {
            const float *row = picture->inverse + (size_t)v * (size_t)w;
            const bool last = !picture->panorama && u == w - 1;
            uint8_t joined = 0;
            if (!last && is_continuous(row[column_of(picture, u - 1)], row[u], row[column_of(picture, u + 1)],
                                       row[column_of(picture, u + 2)]))
                joined |= JOINED_RIGHT;
            if (v + 1 < h &&
                is_continuous(row[v > 0 ? u - w : u], row[u], row[u + w], row[v + 2 < h ? u + 2 * w : u + w]))
                joined |= JOINED_DOWN;
            picture->joined[(size_t)v * (size_t)w + (size_t)u] = joined;
        }
    for (int v = 0; v + 1 < h; v++)
        for (int u = 0; u < w; u++) {
            uint8_t *here = picture->joined + (size_t)v * (size_t)w + (size_t)u;
            const uint8_t *right = picture->joined + (size_t)v * (size_t)w + (size_t)column_of(picture, u + 1);
            if ((*here & 3) == 3 && (*right & JOINED_DOWN) && (here[w] & JOINED_RIGHT))
                *here |= JOINED_DIAGONAL;
        }
}
