#include "capture/mapping/sweep_plan.h"

#include <math.h>
#include <string.h>

// All chosen by hand.
static const double FLOOR_M = 0.25, TALL_M = 2.2; // what stands up, and what is over everything
static const double TRAIL_STEP_M = 0.05;
enum {
    DEPTH_STEP = 16,     // pixels
    BLOCK = 8,           // cells: a metre
    BLOCK_SURFACES = 10, // cells of a block that show surfaces
    SURFACE_SAMPLES = 3, // of a cell that is one
    FEW_POINTS = 4,      // landmarks by which a camera is hardly found
    REACH = 4            // cells: half a metre
};

void sweep_plan_start(struct sweep_plan *plan, double middle_x, double middle_y)
{
    memset(plan, 0, sizeof *plan);
    plan->middle_x = middle_x;
    plan->middle_y = middle_y;
}

static bool index_of(const struct sweep_plan *plan, double x, double y, int *column, int *row)
{
    const double u = (x - plan->middle_x) / SWEEP_CELL_M + SWEEP_CELLS / 2,
                 v = (y - plan->middle_y) / SWEEP_CELL_M + SWEEP_CELLS / 2;
    if (!(u >= 0) || !(v >= 0) || !(u < SWEEP_CELLS) || !(v < SWEEP_CELLS))
        return false;
    *column = (int)u;
    *row = (int)v;
    return true;
}

struct sweep_cell *sweep_plan_cell(struct sweep_plan *plan, double x, double y)
{
    int column, row;
    return index_of(plan, x, y, &column, &row) ? &plan->cell[row][column] : NULL;
}

static void count_up(uint8_t *n) { *n = (uint8_t)(*n + (*n < 255)); }

void sweep_plan_add_depth(struct sweep_plan *plan, const struct lens *lens, const uint16_t *depth,
                          struct pose world_from_camera)
{
    for (int y = DEPTH_STEP / 2; y < lens->height; y += DEPTH_STEP)
        for (int x = DEPTH_STEP / 2; x < lens->width; x += DEPTH_STEP) {
            const double z = depth[(size_t)y * (size_t)lens->width + (size_t)x] * 1e-3;
            if (!(z > 0.3) || z > 6)
                continue;
            const struct vec3 at = pose_apply(world_from_camera, v3_scale(lens_ray(lens, (struct pixel){x, y}), z));
            struct sweep_cell *cell = sweep_plan_cell(plan, at.x, at.y);
            if (cell && at.z < TALL_M)
                count_up(at.z < FLOOR_M ? &cell->floor : &cell->solid);
        }
}

void sweep_plan_add_landmark(struct sweep_plan *plan, struct vec3 world)
{
    struct sweep_cell *cell = sweep_plan_cell(plan, world.x, world.y);
    if (cell)
        count_up(&cell->points);
}

void sweep_plan_set_tag(struct sweep_plan *plan, int32_t id, bool seen, const struct vec3 *world, double sigma_m)
{
    int i = 0;
    while (i < plan->tag_count && plan->tag[i].id != id)
        i++;
    if (i == SWEEP_TAGS)
        return;
    if (i == plan->tag_count)
        plan->tag[plan->tag_count++] = (struct sweep_tag){.id = id};
    struct sweep_tag *tag = &plan->tag[i];
    plan->tags_seen += seen && !tag->seen;
    tag->seen |= seen;
    if (!world)
        return;
    struct sweep_cell *cell = sweep_plan_cell(plan, world->x, world->y);
    if (cell)
        cell->tag = true;
    tag->placed = true;
    tag->x = world->x;
    tag->y = world->y;
    tag->sigma_m = sigma_m;
}

static void add_to_trail(struct sweep_plan *plan)
{
    const float *last = plan->trail[plan->trail_count ? plan->trail_count - 1 : 0];
    if (plan->trail_count && hypot(plan->x - (double)last[0], plan->y - (double)last[1]) < TRAIL_STEP_M)
        return;
    if (plan->trail_count == SWEEP_TRAIL) {
        for (int i = 0; i < SWEEP_TRAIL / 2; i++)
            memcpy(plan->trail[i], plan->trail[2 * i + 1], sizeof plan->trail[i]);
        plan->trail_count = SWEEP_TRAIL / 2;
    }
    plan->trail[plan->trail_count][0] = (float)plan->x;
    plan->trail[plan->trail_count++][1] = (float)plan->y;
}

void sweep_plan_move(struct sweep_plan *plan, const struct pose *world_from_camera)
{
    plan->frames++;
    plan->located = world_from_camera != NULL;
    if (!world_from_camera)
        return;
    plan->frames_located++;
    const struct vec3 ahead = quat_rotate(world_from_camera->rotation, v3(0, 0, 1));
    plan->x = world_from_camera->translation.x;
    plan->y = world_from_camera->translation.y;
    plan->heading_rad = atan2(ahead.y, ahead.x);
    add_to_trail(plan);
}

// ---------------------------------------------------------------- where nothing can be recognised

struct block {
    int surfaces, points;
    bool tag;
    double x, y; // sums over its surfaces, cells
};

static struct block block_at(const struct sweep_plan *plan, int column, int row)
{
    struct block b = {0};
    for (int r = row; r < row + BLOCK; r++)
        for (int c = column; c < column + BLOCK; c++) {
            const struct sweep_cell *cell = &plan->cell[r][c];
            b.points += cell->points;
            b.tag |= cell->tag;
            if (cell->solid < SURFACE_SAMPLES)
                continue;
            b.surfaces++;
            b.x += c;
            b.y += r;
        }
    return b;
}

// Landmarks and tags of the blocks around are in the same picture; a block is bare where they are few, too.
static bool is_bare(const struct sweep_plan *plan, int column, int row, struct block *block)
{
    *block = block_at(plan, column, row);
    int points = block->points;
    bool tag = block->tag;
    if (block->surfaces < BLOCK_SURFACES)
        return false;
    for (int dr = -BLOCK / 2; dr <= BLOCK / 2; dr += BLOCK)
        for (int dc = -BLOCK / 2; dc <= BLOCK / 2; dc += BLOCK) {
            const int c = column + dc, r = row + dr;
            if (c < 0 || r < 0 || c + BLOCK > SWEEP_CELLS || r + BLOCK > SWEEP_CELLS)
                continue;
            const struct block near = block_at(plan, c, r);
            points = near.points > points ? near.points : points;
            tag |= near.tag;
        }
    return points < FEW_POINTS && !tag;
}

void sweep_plan_find_bare(struct sweep_plan *plan)
{
    plan->bare_count = 0;
    for (int row = 0; row + BLOCK <= SWEEP_CELLS; row += BLOCK)
        for (int column = 0; column + BLOCK <= SWEEP_CELLS && plan->bare_count < SWEEP_BARE; column += BLOCK) {
            struct block b;
            if (!is_bare(plan, column, row, &b))
                continue;
            plan->bare[plan->bare_count].x = plan->middle_x + (b.x / b.surfaces + 0.5 - SWEEP_CELLS / 2) * SWEEP_CELL_M;
            plan->bare[plan->bare_count++].y =
                plan->middle_y + (b.y / b.surfaces + 0.5 - SWEEP_CELLS / 2) * SWEEP_CELL_M;
        }
}

double sweep_plan_recognisable(const struct sweep_plan *plan)
{
    int surfaces = 0, good = 0;
    for (int row = 0; row < SWEEP_CELLS; row++)
        for (int column = 0; column < SWEEP_CELLS; column++) {
            if (plan->cell[row][column].solid < SURFACE_SAMPLES)
                continue;
            bool any = false;
            for (int r = row - REACH; r <= row + REACH && !any; r++)
                for (int c = column - REACH; c <= column + REACH && !any; c++)
                    any = r >= 0 && c >= 0 && r < SWEEP_CELLS && c < SWEEP_CELLS &&
                          (plan->cell[r][c].points || plan->cell[r][c].tag);
            surfaces++;
            good += any;
        }
    return surfaces ? (double)good / surfaces : 0;
}

// ---------------------------------------------------------------- of a finished place

void sweep_plan_of_place(const struct place *place, struct sweep_plan *out)
{
    double x = 0, y = 0;
    for (int32_t i = 0; i < place->view_count; i++) {
        x += place->views[i].world_from_camera.translation.x;
        y += place->views[i].world_from_camera.translation.y;
    }
    const int32_t count = place->view_count ? place->view_count : 1;
    sweep_plan_start(out, x / count, y / count);
    const struct calibration *c = &place->calibration;
    for (int32_t i = 0; i < place->view_count; i++) {
        const struct place_view *view = &place->views[i];
        if (view->depth)
            sweep_plan_add_depth(out, &c->depth, view->depth,
                                 pose_multiply(view->world_from_camera, c->color_from_depth));
        sweep_plan_move(out, &view->world_from_camera);
    }
    for (int32_t i = 0; i < place->point_count; i++)
        sweep_plan_add_landmark(out, place->points[i].world);
    for (int32_t i = 0; i < place->tag_count; i++) {
        const struct place_tag *tag = &place->tags[i];
        const double sigma_m = sqrt(fmax((double)(tag->covariance[15] + tag->covariance[18] + tag->covariance[20]), 0));
        sweep_plan_set_tag(out, tag->id, true, &tag->world_from_tag.translation, sigma_m);
    }
    out->located = false;
    out->trail_count = 0; // the order of the views is no path
    out->hint = SWEEP_ENOUGH;
    sweep_plan_find_bare(out);
}
