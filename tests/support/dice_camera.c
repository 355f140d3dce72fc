#include "tests/support/dice_film.h"

#include <stdlib.h>
#include <string.h>

void dice_camera_close(struct dice_camera *c)
{
    world_close(&c->world);
    world_close(&c->passerby);
    free(c->exact);
    free(c->depth);
    free(c->mask);
    free(c->color);
    free(c->passerby_depth);
    free(c->passerby_mask);
    free(c->passerby_color);
    memset(c, 0, sizeof *c);
}

static size_t pixel_count(const struct dice_camera *c)
{
    return (size_t)c->calibration.depth.width * (size_t)c->calibration.depth.height;
}

static enum status open_worlds(struct dice_camera *c)
{
    struct world_options options = dice_world_options(&c->plan, &c->plan.actor);
    enum status status = world_open(&c->world, &options);
    if (status == OK && c->plan.situation == DICE_PASSERBY) {
        options = dice_world_options(&c->plan, &c->plan.passerby);
        status = world_open(&c->passerby, &options);
    }
    return status;
}

enum status dice_camera_open(struct dice_camera *c, const struct dice_plan *plan)
{
    *c = (struct dice_camera){.plan = *plan, .calibration = world_calibration(plan->scale)};
    c->world_from_camera = world_stand_pose(&plan->stand);
    const size_t n = pixel_count(c);
    c->exact = calloc(n, sizeof *c->exact);
    c->depth = calloc(n, sizeof *c->depth);
    c->passerby_depth = calloc(n, sizeof *c->passerby_depth);
    c->mask = calloc(n, 1);
    c->passerby_mask = calloc(n, 1);
    c->color = calloc(n, 3);
    c->passerby_color = calloc(n, 3);
    enum status status =
        c->exact && c->depth && c->passerby_depth && c->mask && c->passerby_mask && c->color && c->passerby_color
            ? open_worlds(c)
            : fail(ERR_MEMORY, "no memory for the images of a film");
    if (status != OK)
        dice_camera_close(c);
    return status;
}

// Puts the passer-by's image over the actor's: each pixel shows the nearer. Shadows on the room: the darker of both.
static void compose(struct dice_camera *c, bool color)
{
    for (size_t i = 0; i < pixel_count(c); i++) {
        const bool nearer = c->passerby_mask[i] && (!c->exact[i] || c->passerby_depth[i] < c->exact[i]);
        uint8_t *to = &c->color[3 * i];
        const uint8_t *from = &c->passerby_color[3 * i];
        for (int k = 0; k < 3 && color; k++)
            to[k] = nearer || (!c->mask[i] && from[k] < to[k]) ? from[k] : to[k];
        if (nearer) {
            c->exact[i] = c->passerby_depth[i];
            c->mask[i] = 2;
        }
    }
}

enum status dice_camera_shoot(struct dice_camera *c, int frame, bool color)
{
    const struct lens *l = &c->calibration.depth;
    const double t = (double)frame / DICE_HZ;
    const uint64_t seed = c->plan.noise_seed + (uint64_t)frame;
    struct world_shot shot = {*l, c->world_from_camera, c->plan.actor.start_s + t, true};
    struct world_image image = {color ? c->color : NULL, c->exact, c->mask};
    enum status status = world_render(c->world, &shot, &image);
    if (status == OK && c->passerby) {
        shot.time_s = c->plan.passerby.start_s + t;
        image = (struct world_image){color ? c->passerby_color : NULL, c->passerby_depth, c->passerby_mask};
        status = world_render(c->passerby, &shot, &image);
        if (status == OK)
            compose(c, color);
    }
    if (status == OK && color)
        world_color_noise(c->color, l->width, l->height, seed);
    return status == OK ? world_depth_noise(l, c->exact, seed, c->depth) : status;
}

enum status dice_camera_background(const struct dice_camera *c, uint16_t *depth)
{
    const struct world_shot shot = {c->calibration.depth, c->world_from_camera, 0, false};
    return world_render(c->world, &shot, &(struct world_image){.depth = depth});
}
