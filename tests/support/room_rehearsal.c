#include "tests/support/room_rehearsal.h"

#include "formats/glb_builder.h"
#include "platform/files/file.h"
#include "platform/files/jpeg.h"
#include "platform/files/png.h"
#include "recording/recorded_things.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void check(enum status status)
{
    if (status != OK) {
        fprintf(stderr, "the rehearsal of the room failed: %s\n", status_message());
        abort();
    }
}

// ---------------------------------------------------------------- a model

enum { ROUND = 24, MOST_CORNERS = 5 * ROUND * 12 };

struct corners {
    float at[MOST_CORNERS][3], normal[MOST_CORNERS][3];
    int count;
};

static void add(struct corners *c, double x, double y, double z, double nx, double ny, double nz)
{
    const double at[3] = {x, y, z}, normal[3] = {nx, ny, nz};
    for (int k = 0; k < 3; k++) {
        c->at[c->count][k] = (float)at[k];
        c->normal[c->count][k] = (float)normal[k];
    }
    c->count++;
}

// About the x axis, from x0 to x1, with both ends.
static void add_cylinder(struct corners *c, double x0, double x1, double r)
{
    for (int i = 0; i < ROUND; i++) {
        const double a = 2 * 3.14159265358979 * i / ROUND, b = 2 * 3.14159265358979 * (i + 1) / ROUND;
        const double ca = cos(a), sa = sin(a), cb = cos(b), sb = sin(b);
        add(c, x0, r * ca, r * sa, 0, ca, sa);
        add(c, x1, r * cb, r * sb, 0, cb, sb);
        add(c, x0, r * cb, r * sb, 0, cb, sb);
        add(c, x0, r * ca, r * sa, 0, ca, sa);
        add(c, x1, r * ca, r * sa, 0, ca, sa);
        add(c, x1, r * cb, r * sb, 0, cb, sb);
        add(c, x1, 0, 0, 1, 0, 0);
        add(c, x1, r * cb, r * sb, 1, 0, 0);
        add(c, x1, r * ca, r * sa, 1, 0, 0);
        add(c, x0, 0, 0, -1, 0, 0);
        add(c, x0, r * ca, r * sa, -1, 0, 0);
        add(c, x0, r * cb, r * sb, -1, 0, 0);
    }
}

void room_model(uint8_t **bytes, size_t *count)
{
    static const double discs[5][3] = {
        {-0.15, -0.1, 0.06}, {-0.1, -0.07, 0.045}, {-0.07, 0.07, 0.016}, {0.07, 0.1, 0.045}, {0.1, 0.15, 0.06}};
    struct corners *c = calloc(1, sizeof *c);
    struct glb g;
    glb_open(&g);
    for (int i = 0; i < 5; i++)
        add_cylinder(c, discs[i][0], discs[i][1], discs[i][2]);
    const int at = glb_add_accessor(&g, c->at, &(struct glb_layout){GLB_FLOAT, 3, c->count, GLB_VERTICES, true});
    const int normal =
        glb_add_accessor(&g, c->normal, &(struct glb_layout){GLB_FLOAT, 3, c->count, GLB_VERTICES, false});
    json_add_number(g.root, "scene", 0);
    json_push_number(json_add_array(json_add_object(json_add_array(g.root, "scenes"), NULL), "nodes"), 0);
    json_add_number(json_add_object(json_add_array(g.root, "nodes"), NULL), "mesh", 0);
    struct json *material = json_add_object(json_add_array(g.root, "materials"), NULL);
    struct json *factor = json_add_array(json_add_object(material, "pbrMetallicRoughness"), "baseColorFactor");
    const double color[4] = {0.6, 0.08, 0.05, 1};
    for (int i = 0; i < 4; i++)
        json_push_number(factor, color[i]);
    struct json *mesh = json_add_object(json_add_array(g.root, "meshes"), NULL);
    struct json *primitive = json_add_object(json_add_array(mesh, "primitives"), NULL);
    json_add_number(primitive, "material", 0);
    struct json *attributes = json_add_object(primitive, "attributes");
    json_add_number(attributes, "POSITION", at);
    json_add_number(attributes, "NORMAL", normal);
    check(glb_print(&g, bytes, count));
    glb_close(&g);
    free(c);
}

void room_photograph(const struct scratch *scratch, uint8_t **bytes, size_t *count)
{
    enum { W = 160, H = 120 };
    static uint8_t rgb[W * H * 3];
    for (int y = 0; y < H; y++)
        for (int x = 0; x < W; x++) {
            const bool disc = abs(y - 60) < 40 && (abs(x - 36) < 20 || abs(x - 124) < 20);
            const bool bar = abs(y - 60) < 9 && abs(x - 80) < 60;
            const uint8_t color[3] = {(uint8_t)(disc  ? 190
                                                : bar ? 130
                                                      : 225 - y / 4),
                                      (uint8_t)(disc  ? 50 + y / 3
                                                : bar ? 132
                                                      : 228 - y / 4),
                                      (uint8_t)(disc  ? 45
                                                : bar ? 140
                                                      : 232 - y / 4)};
            memcpy(rgb + 3 * (y * W + x), color, 3);
        }
    check(png_write(scratch_file(scratch, "photograph.png"), PNG_RGB8, rgb, W, H));
    check(file_read(scratch_file(scratch, "photograph.png"), bytes, count));
}

// ---------------------------------------------------------------- the place and its things

static void film_views(const struct world *w, struct place *place)
{
    const struct lens lens = place->calibration.color;
    const size_t pixels = (size_t)lens.width * (size_t)lens.height;
    uint8_t *rgb = malloc(3 * pixels);
    place->views = calloc(ROOM_VIEWS, sizeof *place->views);
    if (!rgb || !place->views)
        abort();
    for (int i = 0; i < ROOM_VIEWS; i++) {
        struct place_view *v = &place->views[place->view_count++];
        v->world_from_camera = world_sweep_pose(w, (double)WORLD_SWEEP_S * i / ROOM_VIEWS);
        v->depth = malloc(sizeof *v->depth * pixels);
        const struct world_shot shot = {lens, v->world_from_camera, 0, false};
        check(world_render(w, &shot, &(struct world_image){.color = rgb, .depth = v->depth}));
        check(jpeg_encode(rgb, lens.width, lens.height, 92, &v->jpeg, &v->jpeg_bytes));
    }
    free(rgb);
}

static struct recorded_thing thing(const char *name, struct vec3 at, double side_m, double sigma_m)
{
    // Upright, its front to the sensor: x right, y down, z away.
    const double half = sqrt(0.5);
    struct recorded_thing t = {.world_from_thing = {{-half, 0, 0, half}, at},
                               .covariance = {sigma_m * sigma_m, 0, 0, 4 * sigma_m * sigma_m, 0, sigma_m * sigma_m},
                               .width_m = side_m,
                               .height_m = side_m,
                               .sightings = 3};
    snprintf(t.name, sizeof t.name, "%s", name);
    return t;
}

static void write_things(const struct rehearsal *r)
{
    static const char known[] =
        "{\"@context\": \"https://schema.org\", \"@type\": \"Product\", \"name\": \"Dumbbell, 2.5 kg\", "
        "\"description\": \"A short bar with a weight at each end.\", \"weight\": \"2.5 kg\", "
        "\"material\": \"Cast iron, vinyl\", \"instructions\": \"Hold the bar in the middle. Lift with a straight "
        "wrist, "
        "to the shoulder and no higher, and lower it slowly: two seconds up, three seconds down.\"}";
    static const char band[] =
        "{\"@type\": \"Thing\", \"name\": \"Elastic band\", \"description\": \"Stretches to 2 m.\"}";
    struct recorded_thing things[ROOM_THINGS] = {
        thing("dumbbell", v3(0.75, -0.7, 0.95), 0.12, 0.002), thing("band", v3(-0.95, 0.1, 0.9), 0.3, 0.01),
        thing("bokken", v3(1.7, 1.2, 1.2), 0.9, 0.02),        thing("foam roller", v3(1.3, -0.2, 0.1), 0.3, 0.03),
        thing("chair", v3(-1.9, 1.4, 0.5), 0.5, 0.015),       thing("first-aid box", v3(-2.9, 2.2, 1.6), 0.3, 0.2)};
    things[0].knowledge = (char *)(uintptr_t)known;
    things[1].knowledge = (char *)(uintptr_t)band;
    snprintf(things[0].url, sizeof things[0].url, "http://127.0.0.1:9/things/dumbbell");
    things[3].gone = true;
    snprintf(things[5].note, sizeof things[5].note, "Behind the door. Plasters were used up in May.");
    room_model(&things[0].model.bytes, &things[0].model.count);
    room_photograph(&r->scratch, &things[0].image.bytes, &things[0].image.count);
    check(recording_write_things(r->file, things, ROOM_THINGS));
    free(things[0].model.bytes);
    free(things[0].image.bytes);
}

// From the left round the actor, to before the rug.
static void write_drive(const struct rehearsal *r)
{
    struct recorded_drive d = {.size_m = {0.6, 0.5, 1.2}, .path_count = 24};
    for (int i = 0; i <= d.path_count; i++) {
        const double angle = -3 + 0.0875 * i;
        const struct pose at = {quat_from_rotation_vector(v3(0, 0, angle + 1.5707963267948966)),
                                v3(1.7 * cos(angle), 1.7 * sin(angle), 0)};
        if (i < d.path_count)
            d.path[i] = at.translation;
        d.world_from_body = at;
    }
    check(recording_write_drive(r->file, &d));
}

struct rehearsal room_rehearsal_make(void)
{
    struct rehearsal r = rehearsal_make();
    struct world *world;
    struct recording_writer *writer;
    struct world_options options = world_default_options();
    options.threads = 2;
    check(world_open(&world, &options));
    struct place place = film_true_place(world, 0.5);
    film_views(world, &place);
    check(recording_append(&writer, r.file));
    check(recording_put_place(writer, &place));
    check(recording_close(&writer));
    write_things(&r);
    write_drive(&r);
    place_free(&place);
    world_close(&world);
    return r;
}
