// The actor as glTF: read back by hand, vertex by vertex, against linear blend skinning of the avatar; and by Khronos's
// validator, where tools/gltf-validator has fetched it.
#include "tests/support/test.h"

#include "platform/files/file.h"
#include "platform/files/json.h"
#include "reenact/export/actor_export.h"
#include "tests/support/process.h"
#include "tests/support/rehearsed.h"

#include <stdio.h>
#include <unistd.h>

static struct rehearsed rehearsed;
static struct skeleton_track *track;
static uint8_t *glb;
static size_t glb_bytes;

static struct actor_export actor(void)
{
    return (struct actor_export){rehearsed.take, rehearsed.skeletons, track, &rehearsed.avatar, "turn <1>", NULL};
}

// ---------------------------------------------------------------- a reader of what was written

struct model {
    struct json *root;
    const uint8_t *bin;
};

static uint32_t u32_at(const uint8_t *at)
{
    uint32_t value;
    memcpy(&value, at, sizeof value);
    return value;
}

static struct model model_read(const uint8_t *bytes, size_t count)
{
    const uint32_t json_bytes = u32_at(bytes + 12);
    const char *path = scratch_file(&rehearsed.rehearsal.scratch, "model.json");
    struct model m;
    assert_memory_equal(bytes, "glTF", 4);
    EXPECT_INT(u32_at(bytes + 8), count);
    scratch_write(&rehearsed.rehearsal.scratch, "model.json", bytes + 20, json_bytes);
    EXPECT_STATUS(json_read(path, &m.root), OK);
    m.bin = bytes + 20 + json_bytes + 8;
    return m;
}

static double number(const struct json *object, const char *name)
{
    double value = NAN;
    EXPECT_TRUE(json_get_number(json_member(object, name), &value));
    return value;
}

static const void *accessor(const struct model *m, double which)
{
    const struct json *a = json_at(json_member(m->root, "accessors"), (int)which);
    const struct json *v = json_at(json_member(m->root, "bufferViews"), (int)number(a, "bufferView"));
    return m->bin + (size_t)number(v, "byteOffset");
}

// The pose of a node at key `key`, in the scene; -1: at rest.
static struct pose node_pose(const struct model *m, int node, int key)
{
    const struct json *animation = json_at(json_member(m->root, "animations"), 0);
    const struct json *samplers = json_member(animation, "samplers"), *channels = json_member(animation, "channels");
    const struct json *nodes = json_member(m->root, "nodes");
    struct pose local = POSE_IDENTITY;
    const struct json *rotation = json_member(json_at(nodes, node), "rotation"),
                      *translation = json_member(json_at(nodes, node), "translation");
    for (int k = 0; k < 4 && rotation; k++)
        EXPECT_TRUE(json_get_number(json_at(rotation, k), &(&local.rotation.x)[k]));
    for (int k = 0; k < 3 && translation; k++)
        EXPECT_TRUE(json_get_number(json_at(translation, k), &(&local.translation.x)[k]));
    for (int c = 0; c < json_count(channels) && key >= 0; c++) {
        const struct json *target = json_member(json_at(channels, c), "target");
        const char *path = NULL;
        if ((int)number(target, "node") != node || !json_get_string(json_member(target, "path"), &path))
            continue;
        const struct json *sampler = json_at(samplers, (int)number(json_at(channels, c), "sampler"));
        const float *values = accessor(m, number(sampler, "output"));
        const int width = !strcmp(path, "rotation") ? 4 : 3;
        for (int k = 0; k < width; k++)
            *(width == 4 ? &local.rotation.x + k : &local.translation.x + k) = (double)values[key * width + k];
    }
    for (int n = 0; n < json_count(nodes); n++) {
        const struct json *children = json_member(json_at(nodes, n), "children");
        for (int c = 0; c < json_count(children); c++) {
            double child;
            if (json_get_number(json_at(children, c), &child) && (int)child == node)
                return pose_multiply(node_pose(m, n, key), local);
        }
    }
    return local;
}

// Linear blend skinning of a vertex by what the file holds (glTF 2.0, 3.7.3).
static struct vec3 skinned_vertex(const struct model *m, const struct json *attributes, int vertex,
                                  const struct pose *nodes)
{
    const float *position = accessor(m, number(attributes, "POSITION")),
                *weights = accessor(m, number(attributes, "WEIGHTS_0"));
    const uint8_t *joints = accessor(m, number(attributes, "JOINTS_0"));
    const float *inverse = accessor(m, number(json_at(json_member(m->root, "skins"), 0), "inverseBindMatrices"));
    struct vec3 sum = v3(0, 0, 0);
    for (int k = 0; k < 4; k++) {
        const int joint = joints[4 * vertex + k];
        const float *at = position + 3 * vertex, *o = inverse + 16 * joint + 12; // only moved
        const struct vec3 p = v3((double)(at[0] + o[0]), (double)(at[1] + o[1]), (double)(at[2] + o[2]));
        sum = v3_add(sum, v3_scale(pose_apply(nodes[joint], p), (double)weights[4 * vertex + k]));
    }
    return sum;
}

enum { KEY = 5 };

// The avatar's bones at that key.
static struct bone_transforms shown_bones(void)
{
    struct track_sample sample;
    struct bone_transforms joints;
    const int64_t since_ns = take_entry(rehearsed.take, KEY)->time_ns - take_entry(rehearsed.take, 0)->time_ns;
    EXPECT_STATUS(skeleton_track_at(track, since_ns, true, &sample), OK);
    EXPECT_STATUS(bone_transforms_of(&rehearsed.avatar.bind_pose, &sample.skeleton, &joints), OK);
    const struct bone_corrections corrections = avatar_corrections(&rehearsed.avatar, KEY);
    return bone_corrections_apply(&joints, &corrections);
}

static void test_vertices_are_the_avatars(void **state)
{
    (void)state;
    struct model m = model_read(glb, glb_bytes);
    const struct json *primitive = json_at(json_member(json_at(json_member(m.root, "meshes"), 0), "primitives"), 0);
    const struct texture_atlas *atlas = &rehearsed.avatar.atlas;
    const struct json *times = json_at(json_member(json_at(json_member(m.root, "animations"), 0), "samplers"), 0);
    const float *time_s = accessor(&m, number(times, "input"));
    EXPECT_NEAR((double)time_s[KEY],
                (double)(take_entry(rehearsed.take, KEY)->time_ns - take_entry(rehearsed.take, 0)->time_ns) * 1e-9,
                1e-5);
    struct pose nodes[BONE_COUNT];
    for (int b = 0; b < BONE_COUNT; b++)
        nodes[b] = node_pose(&m, b, KEY);
    const struct bone_transforms shown = shown_bones();
    double worst = 0;
    for (int i = 0; i < atlas->mesh.point_count; i += 7) {
        struct vec3 p, n;
        linear_blend_skin(&rehearsed.avatar.skins[atlas->mesh.points[i]], &shown, atlas->points[i], atlas->normals[i],
                          &p, &n);
        const struct vec3 got = skinned_vertex(&m, json_member(primitive, "attributes"), i, nodes);
        worst = fmax(worst, v3_distance(got, v3(p.x, p.z, -p.y))); // y up
    }
    print_message("vertices from glTF: %.7f m at worst\n", worst);
    EXPECT_AT_MOST(worst, 1e-5);
    json_free(&m.root);
}

// Under an armature's bones, of constant length: a T-pose at rest, whose nodes lie where the skin has them, and
// vertices near the avatar's own.
static void test_armature_moves_the_avatar(void **state)
{
    (void)state;
    const enum armature_naming naming = ARMATURE_MIXAMO;
    struct actor_export a = actor();
    uint8_t *bytes;
    size_t count;
    a.armature = &naming;
    EXPECT_STATUS(actor_export_glb(&a, &bytes, &count), OK);
    struct model m = model_read(bytes, count);
    const struct json *nodes = json_member(m.root, "nodes");
    const float *inverse = accessor(&m, number(json_at(json_member(m.root, "skins"), 0), "inverseBindMatrices"));
    struct pose moved[ARMATURE_BONES], rest[ARMATURE_BONES];
    EXPECT_INT(json_count(nodes), ARMATURE_BONES + 2);
    for (int b = 0; b < ARMATURE_BONES; b++) {
        const char *name = "";
        json_get_string(json_member(json_at(nodes, b), "name"), &name);
        assert_string_equal(name, armature_bone_name(naming, (enum armature_bone)b));
        moved[b] = node_pose(&m, b, KEY);
        rest[b] = node_pose(&m, b, -1);
        const float *o = inverse + 16 * b + 12;
        EXPECT_AT_MOST(v3_length(v3_add(rest[b].translation, v3((double)o[0], (double)o[1], (double)o[2]))), 1e-5);
        EXPECT_AT_MOST(v3_length(quat_to_rotation_vector(rest[b].rotation)), 1e-9);
    }
    EXPECT_INT(json_count(json_member(json_at(json_member(m.root, "animations"), 0), "channels")), ARMATURE_BONES + 1);
    const struct json *primitive = json_at(json_member(json_at(json_member(m.root, "meshes"), 0), "primitives"), 0);
    const struct json *attributes = json_member(primitive, "attributes");
    const struct texture_atlas *atlas = &rehearsed.avatar.atlas;
    const struct bone_transforms shown = shown_bones();
    double sum = 0, worst = 0, low = INFINITY, span = 0;
    int points = 0;
    for (int i = 0; i < atlas->mesh.point_count; i += 7, points++) {
        struct vec3 p, n;
        linear_blend_skin(&rehearsed.avatar.skins[atlas->mesh.points[i]], &shown, atlas->points[i], atlas->normals[i],
                          &p, &n);
        const double off_m = v3_distance(skinned_vertex(&m, attributes, i, moved), v3(p.x, p.z, -p.y));
        const struct vec3 at = skinned_vertex(&m, attributes, i, rest);
        sum += off_m;
        worst = fmax(worst, off_m);
        low = fmin(low, at.y);
        span = fmax(span, at.x);
    }
    print_message("vertices under an armature: %.4f m off on average, %.4f m at worst; at rest %.2f m above the floor, "
                  "arms %.2f m\n",
                  sum / points, worst, low, span);
    EXPECT_AT_MOST(sum / points, 0.006); // measured: 4 mm, and 36 mm at a shoulder
    EXPECT_AT_MOST(worst, 0.05);
    EXPECT_NEAR(low, 0, 0.05);
    EXPECT_AT_LEAST(span, 0.6); // an arm is stretched out
    json_free(&m.root);
    free(bytes);
}

static void check_by_validator(const uint8_t *bytes, size_t count)
{
    const char *data = getenv("XDG_DATA_HOME"), *home = getenv("HOME");
    char validator[400], program[600];
    snprintf(validator, sizeof validator, "%s%s/reenact/gltf-validator/index.js", data && *data ? data : home,
             data && *data ? "" : "/.local/share");
    if (access(validator, R_OK) || access("/usr/bin/node", X_OK))
        skip_without("the glTF validator (tools/gltf-validator) and node");
    const char *path = scratch_file(&rehearsed.rehearsal.scratch, "actor.glb");
    scratch_write(&rehearsed.rehearsal.scratch, "actor.glb", bytes, count);
    snprintf(program, sizeof program,
             "require('%s').validateBytes(new Uint8Array(require('fs').readFileSync('%s'))).then("
             "r => console.log(r.issues.numErrors, r.issues.numWarnings, JSON.stringify(r.issues.messages)))",
             validator, path);
    const struct process_result r = PROCESS("/usr/bin/node", "-e", program);
    print_message("%s%s", r.out, r.err);
    EXPECT_INT(r.exit_code, 0);
    assert_memory_equal(r.out, "0 0 ", 4);
}

static void test_khronos_validator_finds_nothing(void **state)
{
    (void)state;
    const enum armature_naming naming = ARMATURE_UNREAL;
    struct actor_export a = actor();
    uint8_t *bytes;
    size_t count;
    check_by_validator(glb, glb_bytes);
    a.armature = &naming;
    EXPECT_STATUS(actor_export_glb(&a, &bytes, &count), OK);
    check_by_validator(bytes, count);
    free(bytes);
}

static void test_page_holds_the_model(void **state)
{
    (void)state;
    char *text;
    size_t count;
    FILE *out = open_memstream(&text, &count);
    assert_non_null(out);
    actor_export_page("turn <1>", glb, glb_bytes, out);
    assert_int_equal(fclose(out), 0);
    assert_non_null(strstr(text, "<title>turn &lt;1&gt;</title>"));
    assert_null(strstr(text, "@MODEL@"));
    assert_null(strstr(text, "https:")); // needs no network
    const char *model = strstr(text, "text/plain\">");
    assert_non_null(model);
    model += strlen("text/plain\">");
    EXPECT_INT(strchr(model, '<') - model, (glb_bytes + 2) / 3 * 4);
    assert_memory_equal(model, "Z2xURg", 6); // "glTF"
    free(text);
}

static void test_mesh_stands_where_the_actor_does(void **state)
{
    (void)state;
    const struct actor_export a = actor();
    char *text;
    size_t count;
    FILE *out = open_memstream(&text, &count);
    assert_non_null(out);
    EXPECT_STATUS(actor_export_mesh_ply(&a, 4, out), OK);
    assert_int_equal(fclose(out), 0);
    const struct surface_mesh *s = &rehearsed.avatar.surface;
    const char *end = strstr(text, "end_header\n");
    assert_non_null(end);
    const char *points = end + strlen("end_header\n");
    EXPECT_INT(count - (size_t)(points - text), 15 * s->point_count + 13 * (s->corner_count / 3));
    const struct take_entry *e = take_entry(rehearsed.take, 4);
    const struct vec3 waist = pose_apply(e->world_from_camera, e->skeleton.joint[JOINT_WAIST]);
    double low = INFINITY, nearest = INFINITY;
    for (int i = 0; i < s->point_count; i++) {
        float p[3];
        memcpy(p, points + 15 * i, sizeof p);
        low = fmin(low, (double)p[2]);
        nearest = fmin(nearest, v3_distance(waist, v3((double)p[0], (double)p[1], (double)p[2])));
    }
    EXPECT_NEAR(low, 0, 0.1); // on the floor
    EXPECT_AT_MOST(nearest, 0.2);
    free(text);
}

static int set_up(void **state)
{
    (void)state;
    if (rehearsed_open(&rehearsed, REHEARSAL_FRAMES) != OK ||
        skeleton_track_open(&track, rehearsed.take, rehearsed.skeletons) != OK)
        return -1;
    const struct actor_export a = actor();
    return actor_export_glb(&a, &glb, &glb_bytes) == OK ? 0 : -1;
}

static int tear_down(void **state)
{
    (void)state;
    free(glb);
    skeleton_track_close(&track);
    rehearsed_close(&rehearsed);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_vertices_are_the_avatars),         cmocka_unit_test(test_armature_moves_the_avatar),
        cmocka_unit_test(test_khronos_validator_finds_nothing),  cmocka_unit_test(test_page_holds_the_model),
        cmocka_unit_test(test_mesh_stands_where_the_actor_does),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
