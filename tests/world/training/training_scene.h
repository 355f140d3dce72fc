// What one depth image shows by which a body model is trained: a person of any build in any posture, seen from
// anywhere, in a room with furniture, things in the hands, other people, or no person. Drawn from a seed: image `index`
// of a seed is the same whatever was drawn before. Internal to tests/world.
//
// World axes as in world.h, the person near the origin. Chosen by hand, uniformly unless said otherwise: sensor 0.8 to
// 5 m away and 0.3 to 2.6 m high, aimed at the body or past it, one in ten turned by a quarter; of the postures four in
// five are posture.h's, the others of motion capture with arms of other motions.
#pragma once
#include "tests/world/figure.h"
#include "tests/world/motion.h"
#include "tests/world/posture.h"

enum training_sensor {
    TRAINING_STRUCTURED,       // a Kinect v1 or Xtion, 320 x 240
    TRAINING_STRUCTURED_SMALL, // the same, every other pixel
    TRAINING_TIME_OF_FLIGHT,   // a Kinect v2 or Azure Kinect, 256 x 212
    TRAINING_LIDAR,            // a telephone's, 256 x 192
    TRAINING_SENSORS
};

// The people and motions that images are drawn from.
struct training_people {
    struct figure *figures; // figure.h's own first
    int figure_count, own_count;
    struct figure_motion **motions;
    int motion_count;
};

struct training_people_wish {
    uint64_t seed;               // of the figures
    int figures;                 // how many
    const char *bodies;          // a folder of further figures (training_figure.h); NULL: none
    const char *folder;          // of BVH files; NULL: postures alone
    const char *const *held_out; // file names that are left out; NULL-terminated, or NULL
};
// ERR_MISSING: no BVH file or no figure there. ERR_INPUT, ERR_CORRUPT, ERR_IO, ERR_MEMORY. *out is then zeroed.
MUST_CHECK enum status training_people_open(struct training_people *out, const struct training_people_wish *wish);
void training_people_close(struct training_people *people); // zeroed is fine

enum training_solid_kind { SOLID_BOX, SOLID_ROD };
// A box about the vertical, or a rod with round ends; a rod of no length is a ball.
struct training_solid {
    enum training_solid_kind kind;
    struct vec3 at, half; // box: its middle and half its sides; rod: one end
    double turned;        // box, radians
    struct vec3 to;       // rod: the other end
    double radius_m;      // rod
};

enum { TRAINING_WALLS = 3, TRAINING_SOLIDS = 16, TRAINING_PEOPLE = 2 };

struct training_scene {
    enum training_sensor sensor;
    struct lens lens;
    struct pose world_from_camera;
    uint64_t noise_seed;
    struct training_wall {
        struct vec3 at, normal; // towards the room
    } wall[TRAINING_WALLS];
    struct training_solid solid[TRAINING_SOLIDS];
    int wall_count, solid_count;
    struct training_person {
        const struct figure *figure;
        struct posed posed;    // world axes
        double heading_rad;    // 0: along -y
        int posture;           // enum posture; POSTURES: of a motion
    } person[TRAINING_PEOPLE]; // the first is the one that is looked for
    int person_count;          // 0: no person is there
};

void training_scene_draw(const struct training_people *people, uint64_t seed, int index, struct training_scene *out);
