#include "tests/support/stereo_set.h"

#include "tests/support/random.h"

#include <stdlib.h>
#include <string.h>

enum { RINGS = 3, SPOKES = 8 }; // of twice as many the centroids differ by 1e-4 px at most
#define DISC_SHARE 0.3          // of the pitch: a disc's radius

// The centroid of a disc's image, by summing area elements. False: a part of it is outside the picture.
static bool disc_centroid(const struct lens *lens, double max_r2, struct pose camera_from_board, struct vec3 centre,
                          double radius_m, struct pixel *out)
{
    double sum = 0, x = 0, y = 0;
    for (int ring = 0; ring < RINGS; ring++)
        for (int spoke = 0; spoke < SPOKES; spoke++) {
            // Rings of equal area, each represented by the radius that halves its area.
            const double radius = radius_m * sqrt((ring + 0.5) / RINGS), angle = 2 * M_PI * spoke / SPOKES;
            const struct vec3 p =
                pose_apply(camera_from_board, v3_add(centre, v3(radius * cos(angle), radius * sin(angle), 0)));
            if (!(p.z > 0.01) || p.x * p.x + p.y * p.y > max_r2 * p.z * p.z)
                return false;
            const struct pixel at = lens_project(lens, p);
            if (!(at.x > 2 && at.y > 2 && at.x < lens->width - 3 && at.y < lens->height - 3))
                return false;
            const double weight = 1 / (p.z * p.z * p.z);
            sum += weight;
            x += weight * at.x;
            y += weight * at.y;
        }
    *out = (struct pixel){x / sum, y / sum};
    return true;
}

static struct lens draw_lens(struct rng *rng, int width, int height, double focal_px)
{
    struct lens lens;
    do {
        lens = (struct lens){.width = width, .height = height};
        lens.fx = focal_px * rng_between(rng, 0.98, 1.02);
        lens.fy = lens.fx * rng_between(rng, 0.99, 1.01);
        lens.cx = (width - 1) / 2.0 + width * rng_between(rng, -0.03, 0.03);
        lens.cy = (height - 1) / 2.0 + height * rng_between(rng, -0.03, 0.03);
        lens.k1 = rng_between(rng, -0.35, 0.12);
        lens.k2 = -0.3 * lens.k1 + rng_between(rng, -0.03, 0.03);
        lens.p1 = rng_between(rng, -0.001, 0.001);
        lens.p2 = rng_between(rng, -0.001, 0.001);
    } while (lens_check(&lens, "drawn") != OK);
    return lens;
}

// The lattice as a finder gives it: turned by quarter turns, then from 0 on.
static void hide_origin(struct circle *circles, int count, int quarter)
{
    int column = 0, row = 0;
    for (int pass = 0; pass < 2; pass++)
        for (int i = 0; i < count; i++) {
            struct circle *c = &circles[i];
            if (pass) {
                c->column -= column;
                c->row -= row;
                continue;
            }
            for (int q = 0; q < quarter; q++) {
                const int turned = -c->row;
                c->row = c->column;
                c->column = turned;
            }
            column = !i || c->column < column ? c->column : column;
            row = !i || c->row < row ? c->row : row;
        }
}

static int see(struct stereo_set *set, struct rng *rng, int pair, int camera, struct pose left_from_board)
{
    const struct lens *lens = camera ? &set->rig.right : &set->rig.left;
    const struct pose pose =
        camera ? pose_multiply(pose_inverse(set->rig.left_from_right), left_from_board) : left_from_board;
    const double pitch = set->board.pitch_m, max_r2 = lens_max_radius2(lens);
    int count = 0;
    for (int row = 0; row < set->board.rows; row++)
        for (int column = 0; column < set->board.columns; column++) {
            struct circle *c = &set->circles[pair][camera][count];
            const double dx = rng_normal(rng) * set->noise_px;
            const double dy = rng_normal(rng) * set->noise_px;
            if (!disc_centroid(lens, max_r2, pose, v3(column * pitch, row * pitch, 0), DISC_SHARE * pitch, &c->at))
                continue;
            const struct vec3 p = pose_apply(pose, v3(column * pitch, row * pitch, 0));
            const struct vec3 normal = quat_rotate(pose.rotation, v3(0, 0, 1));
            const double radius_px = DISC_SHARE * pitch * lens->fx / p.z;
            c->area_px = M_PI * radius_px * radius_px * fabs(v3_dot(v3_unit(p), normal));
            c->at.x += dx;
            c->at.y += dy;
            c->column = column;
            c->row = row;
            set->place[pair][camera][count].column = column;
            set->place[pair][camera][count].row = row;
            count++;
        }
    set->views[pair].circles[camera] = set->circles[pair][camera];
    set->views[pair].count[camera] = count;
    hide_origin(set->circles[pair][camera], count, rng_pick(rng, 4));
    return count;
}

// A board in the left camera's axes: turned, and its middle where it is seen at `x`, `y` of half the picture.
static struct pose draw_board(const struct stereo_set *set, struct rng *rng, double distance_m)
{
    const struct lens *lens = &set->rig.left;
    const double pitch = rng_between(rng, -set->tilt_rad, set->tilt_rad);
    const double yaw = rng_between(rng, -set->tilt_rad, set->tilt_rad);
    const double roll = rng_between(rng, -0.5, 0.5);
    const double x = rng_between(rng, -0.6, 0.6) * lens->width / (2 * lens->fx);
    const double y = rng_between(rng, -0.6, 0.6) * lens->height / (2 * lens->fy);
    const struct quat turn =
        quat_multiply(quat_from_rotation_vector(v3(pitch, yaw, 0)), quat_from_rotation_vector(v3(0, 0, roll)));
    const struct vec3 middle = quat_rotate(
        turn, v3((set->board.columns - 1) * set->board.pitch_m / 2, (set->board.rows - 1) * set->board.pitch_m / 2, 0));
    return (struct pose){
        turn,
        v3_sub(v3_add(v3_scale(v3(x, y, 1), distance_m), v3_scale(set->rig.left_from_right.translation, 0.5)), middle)};
}

void stereo_set_make(struct stereo_set *set, uint64_t seed, int index)
{
    static const int sizes[4][2] = {{320, 240}, {640, 480}, {1280, 720}, {1920, 1080}};
    struct rng rng = rng_of(seed, index);
    memset(set, 0, sizeof *set);
    const int size = rng_pick(&rng, 4);
    set->width = sizes[size][0];
    set->height = sizes[size][1];
    set->pairs = 8 + rng_pick(&rng, 13);
    set->noise_px = rng_between(&rng, 0.02, 0.15);
    set->tilt_rad = rng_between(&rng, 0.15, 0.8);
    set->board.columns = 6 + rng_pick(&rng, 7);
    set->board.rows = 5 + rng_pick(&rng, 5);
    set->board.pitch_m = rng_between(&rng, 0.015, 0.04);
    const double focal_px = set->width * exp(rng_between(&rng, log(0.55), log(2.2)));
    set->rig.left = draw_lens(&rng, set->width, set->height, focal_px);
    set->rig.right = draw_lens(&rng, set->width, set->height, focal_px);
    const double near_m = set->board.rows * set->board.pitch_m * focal_px / set->height; // fills the picture's height
    const double baseline_m = near_m * rng_between(&rng, 0.1, 0.4);
    const double turn_x = rng_between(&rng, -0.08, 0.08), turn_y = rng_between(&rng, -0.08, 0.08);
    const double turn_z = rng_between(&rng, -0.08, 0.08);
    set->rig.left_from_right = (struct pose){quat_from_rotation_vector(v3(turn_x, turn_y, turn_z)),
                                             v3(baseline_m, 0.03 * baseline_m, -0.02 * baseline_m)};
    const int whole = set->board.columns * set->board.rows;
    for (int pair = 0; pair < set->pairs;) {
        const struct pose board = draw_board(set, &rng, near_m * rng_between(&rng, 1.1, 2.5));
        const int left = see(set, &rng, pair, 0, board), right = see(set, &rng, pair, 1, board);
        const bool cut_off = pair % 2 && left >= 16 && right >= 16;
        pair += cut_off || (left == whole && right == whole);
    }
}
