#include "surround/picture/surround_mesh.h"

#include "base/memory.h"

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

enum status surround_mesh_make(struct surround_mesh *mesh, const struct surround_picture *p, float tolerance)
{
    struct maker m = {.p = p, .tolerance = tolerance, .mesh = mesh};
    *mesh = (struct surround_mesh){0};
    int size = BLOCK;
    while ((float)(2 * size) * pixel_angle(p) <= PIECE_RAD)
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

enum status surround_picture_make_mesh(struct surround_picture *p)
{
    surround_picture_free_mesh(p);
    p->mesh = calloc(1, sizeof *p->mesh);
    const enum status status = p->mesh ? surround_mesh_make(p->mesh, p, surround_mesh_tolerance(p))
                                       : fail(ERR_MEMORY, "no memory for a picture's mesh");
    if (status != OK)
        surround_picture_free_mesh(p);
    return status;
}
