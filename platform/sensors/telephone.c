#include "platform/sensors/telephone.h"

#include "base/pixels.h"

#include <stdlib.h>
#include <string.h>

// ---------------------------------------------------------------- poses

bool telephone_pose(struct quat rotation, struct vec3 translation, enum telephone_axes axes,
                    struct pose *world_from_camera)
{
    const double half = 0.70710678118654752;
    const struct pose house_from_arkit = {{half, 0, 0, half}, {0, 0, 0}}; // y up to z up: a quarter turn about x
    const struct pose backward_from_forward = {{1, 0, 0, 0}, {0, 0, 0}};  // half a turn about x
    const double squares =
        rotation.x * rotation.x + rotation.y * rotation.y + rotation.z * rotation.z + rotation.w * rotation.w;
    if (!(fabs(squares - 1) < 0.02) || !v3_finite(translation) || !(v3_length(translation) < 1e6))
        return false;
    const struct pose given = {quat_unit(rotation), translation};
    *world_from_camera = pose_multiply(house_from_arkit, given);
    if (axes == TELEPHONE_BACKWARD)
        *world_from_camera = pose_multiply(*world_from_camera, backward_from_forward);
    return true;
}

// By which quarter turns the images are upright, by up in them on average; none where the camera looked down or up all
// the time.
static int upright_turns(const struct telephone_poses *poses)
{
    struct vec3 up = {0, 0, 0};
    int64_t known = 0;
    for (int64_t i = 0; i < poses->count; i++)
        if (poses->known[i]) {
            up = v3_add(up, quat_rotate(quat_conjugate(poses->at[i].rotation), v3(0, 0, 1)));
            known++;
        }
    if (hypot(up.x, up.y) < 0.3 * (double)known) // 17 degrees from the vertical
        return 0;
    if (fabs(up.y) >= fabs(up.x))
        return up.y > 0 ? 2 : 0; // y is down in the image
    return up.x > 0 ? 3 : 1;
}

void telephone_set_odometry(const struct telephone *telephone, const struct telephone_poses *poses, int64_t at,
                            struct frame *out)
{
    if (at >= poses->count || !poses->known[at])
        return;
    const double quarter = 1.57079632679489662;
    const struct quat stored_from_turned = quat_from_rotation_vector(v3(0, 0, -quarter * telephone->turns));
    out->has_odometry = true;
    out->odometry_from_camera = poses->at[at];
    out->odometry_from_camera.rotation = quat_multiply(poses->at[at].rotation, stored_from_turned);
}

// ---------------------------------------------------------------- lenses

static struct lens lens_at_size(const struct lens *lens, int width, int height)
{
    struct lens out = *lens;
    const double x = (double)width / lens->width, y = (double)height / lens->height;
    out.width = width;
    out.height = height;
    out.fx *= x;
    out.fy *= y;
    out.cx = (lens->cx + 0.5) * x - 0.5; // (0, 0) is the middle of the first pixel
    out.cy = (lens->cy + 0.5) * y - 0.5;
    return out;
}

// Of the image turned by a clockwise quarter.
static struct lens lens_turned(const struct lens *lens)
{
    struct lens out = *lens;
    out.width = lens->height;
    out.height = lens->width;
    out.fx = lens->fy;
    out.fy = lens->fx;
    out.cx = lens->height - 1 - lens->cy;
    out.cy = lens->cx;
    return out;
}

static enum status check_sizes(const char *name, const struct lens *color, const int depth_size[2])
{
    if (!image_size_is_usable(color->width, color->height) || !image_size_is_usable(depth_size[0], depth_size[1]))
        return fail(ERR_INPUT, "%s: images of %d x %d pixels with depth of %d x %d cannot be used", name, color->width,
                    color->height, depth_size[0], depth_size[1]);
    const double shape = (double)color->width * depth_size[1] / ((double)color->height * depth_size[0]);
    if (!(fabs(shape - 1) < 0.02))
        return fail(ERR_INPUT,
                    "%s: its colour has %d x %d pixels and its depth %d x %d, which is another shape, so that it is "
                    "not known which parts of them belong together",
                    name, color->width, color->height, depth_size[0], depth_size[1]);
    return OK;
}

enum status telephone_open(struct telephone *telephone, const char *name, const struct lens *color,
                           const int depth_size[2], const struct telephone_poses *poses,
                           struct calibration *calibration)
{
    *telephone = (struct telephone){
        .turns = upright_turns(poses), .color = *color, .width = depth_size[0], .height = depth_size[1]};
    enum status status = check_sizes(name, color, depth_size);
    if (status != OK)
        return status;
    if (lens_check(color, "colour") != OK)
        return fail(ERR_INPUT, "%s: %s", name, status_message());
    *calibration = (struct calibration){.color = *color,
                                        .depth = lens_at_size(color, depth_size[0], depth_size[1]),
                                        .registered = true,
                                        .color_from_depth = POSE_IDENTITY};
    for (int i = 0; i < telephone->turns; i++) {
        calibration->color = lens_turned(&calibration->color);
        calibration->depth = lens_turned(&calibration->depth);
    }
    const size_t pixels = lens_pixels(color), samples = lens_pixels(&calibration->depth);
    telephone->rgb = malloc(3 * pixels);
    telephone->turned = malloc(3 * pixels);
    telephone->mm = malloc(samples * sizeof *telephone->mm);
    telephone->turned_mm = malloc(samples * sizeof *telephone->turned_mm);
    if (!telephone->rgb || !telephone->turned || !telephone->mm || !telephone->turned_mm)
        return fail(ERR_MEMORY, "no memory for the images of %s", name);
    return OK;
}

void telephone_close(struct telephone *telephone)
{
    free(telephone->rgb);
    free(telephone->turned);
    free(telephone->mm);
    free(telephone->turned_mm);
    *telephone = (struct telephone){.turns = 0};
}

// ---------------------------------------------------------------- images

// Where the pixel (x, y) of a width x height image lies after the turns.
static size_t turned_index(int turns, int width, int height, int x, int y)
{
    const int right = width - 1 - x, below = height - 1 - y;
    switch (turns) {
    case 1: return (size_t)x * (size_t)height + (size_t)below;
    case 2: return (size_t)below * (size_t)width + (size_t)right;
    case 3: return (size_t)right * (size_t)height + (size_t)y;
    default: return (size_t)y * (size_t)width + (size_t)x;
    }
}

const uint8_t *telephone_color(struct telephone *telephone)
{
    const struct lens *lens = &telephone->color;
    const uint8_t *from = telephone->rgb;
    if (!telephone->turns)
        return from;
    for (int y = 0; y < lens->height; y++)
        for (int x = 0; x < lens->width; x++, from += 3)
            memcpy(telephone->turned + 3 * turned_index(telephone->turns, lens->width, lens->height, x, y), from, 3);
    return telephone->turned;
}

const uint16_t *telephone_depth(struct telephone *telephone)
{
    const uint16_t *from = telephone->mm;
    if (!telephone->turns)
        return from;
    for (int y = 0; y < telephone->height; y++)
        for (int x = 0; x < telephone->width; x++)
            telephone->turned_mm[turned_index(telephone->turns, telephone->width, telephone->height, x, y)] = *from++;
    return telephone->turned_mm;
}

void telephone_drop_guesses(struct telephone *telephone, const uint8_t *confidence)
{
    const size_t samples = (size_t)telephone->width * (size_t)telephone->height;
    for (size_t i = 0; confidence && i < samples; i++)
        if (!confidence[i])
            telephone->mm[i] = 0;
}
