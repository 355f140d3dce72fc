#include "tests/world/posture.h"

#include "tests/world/numbers.h"

#include <string.h>

static const double DEGREE = 3.14159265358979323846 / 180;
static const struct quat UNTURNED = {0, 0, 0, 1};

// ---------------------------------------------------------------- kinds

// Degrees.
struct range {
    double low, high;
};

enum { ARMS_FREE = 1, ARMS_PROP = 2 }; // how arms are drawn
enum {
    LEGS_FROM_VERTICAL = 1, // hips are flexed against the vertical, not against the pelvis
    FLAT_FEET = 2,          // soles are level
    SETTLES = 4,            // falls until it is supported
    ON_PELVIS = 8,          // stays where the pelvis is; else where the feet, or the knees, are
    ON_KNEES = 16,
    ALIKE = 32,               // both legs do about the same
    SHIN_FROM_VERTICAL = 128, // the shin's angle is drawn instead of the knee's
    FEET_ON_SEAT = 64,        // the knees are bent until the feet are as low as the pelvis
};

// Ranges of what healthy people do, chosen by hand from pictures of exercises; the second leg's, where it differs.
struct kind {
    const char *name;
    int arms, flags;
    struct range pitch, roll, chest_pitch;
    struct range flexed, apart, turned, knee, toes;
    bool differs;
    struct range flexed2, knee2;
};

static const struct kind kinds[POSTURES] = {
    [POSTURE_STANDING] = {"standing",
                          ARMS_FREE,
                          LEGS_FROM_VERTICAL | FLAT_FEET | ALIKE,
                          {-5, 12},
                          {-4, 4},
                          {-6, 12},
                          {-8, 14},
                          {0, 14},
                          {0, 25},
                          {0, 18},
                          {0, 0},
                          false,
                          {0, 0},
                          {0, 0}},
    [POSTURE_ONE_LEG] = {"one-leg",
                         ARMS_FREE,
                         LEGS_FROM_VERTICAL,
                         {-10, 30},
                         {-6, 6},
                         {-8, 12},
                         {-4, 8},
                         {0, 8},
                         {0, 15},
                         {0, 15},
                         {0, 0},
                         true,
                         {-40, 95},
                         {0, 120}},
    [POSTURE_BENT] = {"bent",
                      ARMS_FREE,
                      LEGS_FROM_VERTICAL | FLAT_FEET | ALIKE,
                      {35, 90},
                      {-6, 6},
                      {0, 35},
                      {-6, 30},
                      {0, 18},
                      {0, 25},
                      {0, 60},
                      {0, 0},
                      false,
                      {0, 0},
                      {0, 0}},
    [POSTURE_CROUCHING] = {"crouching",
                           ARMS_FREE,
                           LEGS_FROM_VERTICAL | ALIKE,
                           {10, 45},
                           {-6, 6},
                           {0, 25},
                           {75, 115},
                           {3, 30},
                           {0, 30},
                           {95, 140},
                           {0, 20},
                           false,
                           {0, 0},
                           {0, 0}},
    [POSTURE_SITTING] = {"sitting",
                         ARMS_FREE,
                         LEGS_FROM_VERTICAL,
                         {-18, 25},
                         {-4, 4},
                         {-5, 25},
                         {72, 100},
                         {0, 22},
                         {-5, 20},
                         {55, 110},
                         {-10, 15},
                         false,
                         {0, 0},
                         {0, 0}},
    [POSTURE_WHEELCHAIR] = {"wheelchair",
                            ARMS_FREE,
                            LEGS_FROM_VERTICAL | ALIKE,
                            {-15, 10},
                            {-5, 5},
                            {-5, 20},
                            {78, 95},
                            {0, 14},
                            {-5, 10},
                            {65, 95},
                            {-5, 10},
                            false,
                            {0, 0},
                            {0, 0}},
    [POSTURE_SITTING_ON_FLOOR] = {"sitting-on-floor",
                                  ARMS_FREE,
                                  LEGS_FROM_VERTICAL | ON_PELVIS | FEET_ON_SEAT,
                                  {-25, 20},
                                  {-4, 4},
                                  {0, 30},
                                  {88, 128},
                                  {0, 45},
                                  {0, 50},
                                  {0, 0},
                                  {0, 30},
                                  false,
                                  {0, 0},
                                  {0, 0}},
    [POSTURE_KNEELING] = {"kneeling",
                          ARMS_FREE,
                          LEGS_FROM_VERTICAL | ON_KNEES | ALIKE | SHIN_FROM_VERTICAL,
                          {-8, 20},
                          {-4, 4},
                          {-5, 15},
                          {-5, 20},
                          {0, 15},
                          {0, 15},
                          {86, 97},
                          {20, 60},
                          false,
                          {0, 0},
                          {0, 0}},
    [POSTURE_ON_HEELS] = {"on-heels",
                          ARMS_FREE,
                          LEGS_FROM_VERTICAL | ON_KNEES | ALIKE | SHIN_FROM_VERTICAL,
                          {-5, 35},
                          {-4, 4},
                          {0, 30},
                          {40, 66},
                          {0, 15},
                          {0, 10},
                          {86, 96},
                          {40, 70},
                          false,
                          {0, 0},
                          {0, 0}},
    [POSTURE_HALF_KNEELING] = {"half-kneeling",
                               ARMS_FREE,
                               LEGS_FROM_VERTICAL | ON_KNEES | SHIN_FROM_VERTICAL,
                               {-8, 25},
                               {-4, 4},
                               {-5, 20},
                               {-12, 12},
                               {0, 10},
                               {0, 10},
                               {86, 97},
                               {10, 50},
                               true,
                               {93, 103},
                               {-15, 15}},
    [POSTURE_ALL_FOURS] = {"all-fours",
                           ARMS_PROP,
                           LEGS_FROM_VERTICAL | SETTLES | ON_KNEES | SHIN_FROM_VERTICAL,
                           {65, 95},
                           {-5, 5},
                           {-15, 15},
                           {-12, 20},
                           {0, 12},
                           {0, 5},
                           {86, 98},
                           {30, 60},
                           false,
                           {0, 0},
                           {0, 0}},
    [POSTURE_PUSH_UP] = {"push-up",
                         ARMS_PROP,
                         SETTLES | ON_PELVIS | ALIKE,
                         {60, 88},
                         {-3, 3},
                         {-8, 8},
                         {-8, 20},
                         {0, 10},
                         {0, 5},
                         {0, 12},
                         {-50, -20},
                         false,
                         {0, 0},
                         {0, 0}},
    [POSTURE_LYING_ON_BACK] = {"lying-on-back",
                               ARMS_FREE,
                               SETTLES | ON_PELVIS,
                               {-96, -84},
                               {-8, 8},
                               {-5, 12},
                               {0, 95},
                               {0, 25},
                               {0, 25},
                               {0, 110},
                               {0, 40},
                               false,
                               {0, 0},
                               {0, 0}},
    [POSTURE_BRIDGE] = {"bridge",
                        ARMS_FREE,
                        SETTLES | ON_PELVIS | ALIKE,
                        {-125, -98},
                        {-3, 3},
                        {-10, 5},
                        {-10, 25},
                        {3, 15},
                        {0, 10},
                        {75, 105},
                        {0, 10},
                        false,
                        {0, 0},
                        {0, 0}},
    [POSTURE_LYING_ON_SIDE] = {"lying-on-side",
                               ARMS_FREE,
                               SETTLES | ON_PELVIS,
                               {-10, 15},
                               {78, 100},
                               {0, 30},
                               {0, 95},
                               {-5, 12},
                               {0, 10},
                               {0, 110},
                               {0, 40},
                               false,
                               {0, 0},
                               {0, 0}},
    [POSTURE_LYING_ON_FRONT] = {"lying-on-front",
                                ARMS_FREE,
                                SETTLES | ON_PELVIS,
                                {84, 96},
                                {-8, 8},
                                {-25, 5},
                                {-12, 8},
                                {0, 25},
                                {-10, 20},
                                {0, 95},
                                {20, 60},
                                false,
                                {0, 0},
                                {0, 0}},
};

const char *posture_name(enum posture posture) { return kinds[posture].name; }

bool posture_named(const char *name, enum posture *out)
{
    for (int k = 0; k < POSTURES; k++)
        if (!strcmp(name, kinds[k].name)) {
            *out = (enum posture)k;
            return true;
        }
    return false;
}

// ---------------------------------------------------------------- drawing

static double draw(struct range range, struct rng *rng) { return rng_between(rng, range.low, range.high) * DEGREE; }

static struct posture_leg draw_leg(const struct kind *kind, bool second, struct rng *rng)
{
    struct posture_leg leg;
    leg.flexed = draw(second && kind->differs ? kind->flexed2 : kind->flexed, rng);
    leg.apart = draw(kind->apart, rng);
    leg.turned = draw(kind->turned, rng);
    leg.knee = draw(second && kind->differs ? kind->knee2 : kind->knee, rng);
    if (kind->flags & SHIN_FROM_VERTICAL)
        leg.knee += leg.flexed;
    leg.toes = draw(kind->toes, rng);
    return leg;
}

static struct vec3 near(struct vec3 direction, double sigma, struct rng *rng)
{
    return v3_unit(v3_add(v3_unit(direction), rng_normal3(rng, sigma)));
}

// Hanging, before the body, raised, sideways, hands on hips, in the lap, forearms crossed, at the head; or anything
// that goes neither behind the back nor through the chest.
static struct posture_arm draw_free_arm(struct rng *rng)
{
    static const struct posture_arm usual[] = {
        {{0.15, 0, -1}, {0.1, -0.2, -1}},
        {{0.1, -0.8, -0.5}, {0, -1, -0.2}},
        {{0.2, -0.1, 1}, {0, -0.1, 1}},
        {{1, 0, 0}, {1, -0.1, 0}},
        {{0.7, 0.35, -0.7}, {-0.6, -0.5, -0.5}},
        {{0.1, -0.3, -0.95}, {-0.15, -0.95, -0.2}},
        {{0.25, -0.5, -0.8}, {-0.9, -0.35, 0.25}},
        {{0.7, -0.2, 0.5}, {-0.6, 0, 0.8}},
    };
    const int pick = rng_pick(rng, COUNT_OF(usual) + 3);
    struct posture_arm arm;
    if (pick < (int)COUNT_OF(usual)) {
        arm.upper = near(usual[pick].upper, 0.15, rng);
        arm.fore = near(usual[pick].fore, 0.15, rng);
        return arm;
    }
    do
        arm.upper = v3_unit(rng_normal3(rng, 1));
    while (arm.upper.y > 0.45 || arm.upper.x < -0.5);
    do
        arm.fore = v3_unit(rng_normal3(rng, 1));
    while (v3_dot(arm.upper, arm.fore) < -0.75 || arm.fore.y > 0.5);
    return arm;
}

// Straight down, or with the elbows bent outwards.
static struct posture_arm draw_prop(struct rng *rng)
{
    const double bent = rng_uniform(rng) < 0.6 ? 0 : rng_between(rng, 0, 1.2);
    return (struct posture_arm){near(v3(sin(bent), 0.4 * sin(bent), -cos(bent)), 0.06, rng),
                                near(v3(-0.3 * sin(bent), 0, -1), 0.06, rng)};
}

struct posture_pose posture_draw(enum posture posture, bool swapped, struct rng *rng)
{
    const struct kind *kind = &kinds[posture];
    struct posture_pose pose = {.second = swapped ? LEFT : RIGHT};
    pose.pitch = draw(kind->pitch, rng);
    pose.roll = draw(kind->roll, rng) * (swapped ? -1 : 1);
    pose.chest_pitch = draw(kind->chest_pitch, rng);
    pose.chest_yaw = draw((struct range){-30, 30}, rng);
    pose.chest_roll = draw((struct range){-10, 10}, rng);
    pose.head_pitch = draw((struct range){-25, 30}, rng);
    pose.head_yaw = draw((struct range){-50, 50}, rng);
    for (int i = 0; i < 2; i++) {
        const int side = swapped ? 1 - i : i;
        pose.leg[side] = draw_leg(kind, i == 1, rng);
        pose.arm[side] = kind->arms == ARMS_PROP ? draw_prop(rng) : draw_free_arm(rng);
    }
    if (kind->arms == ARMS_PROP) { // both hands carry
        pose.chest_yaw *= 0.2;
        pose.arm[RIGHT] = pose.arm[LEFT];
    }
    const double *a = &pose.leg[LEFT].flexed;
    double *b = &pose.leg[RIGHT].flexed;
    for (size_t k = 0; k < sizeof pose.leg[0] / sizeof *a && (kind->flags & ALIKE); k++)
        b[k] = a[k] + 0.15 * (b[k] - a[k]);
    return pose;
}

// Along the great circle; between opposite ones by way of the front.
static struct vec3 mix_directions(struct vec3 a, struct vec3 b, double share)
{
    const double angle = acos(fmin(1, fmax(-1, v3_dot(a, b))));
    struct vec3 axis = v3_cross(a, b);
    if (v3_length(axis) < 0.05)
        axis = v3_add(axis, v3_scale(v3_cross(a, v3(0.1, -1, 0.1)), 0.1));
    return v3_unit(quat_rotate(quat_from_rotation_vector(v3_scale(v3_unit(axis), share * angle)), a));
}

struct posture_pose posture_mix(const struct posture_pose *a, const struct posture_pose *b, double share)
{
    struct posture_pose out;
    const double *x = &a->second, *y = &b->second;
    double *o = &out.second;
    for (size_t k = 0; k < sizeof out / sizeof *o; k++)
        o[k] = x[k] + share * (y[k] - x[k]);
    for (int side = 0; side < 2; side++) {
        out.arm[side].upper = mix_directions(a->arm[side].upper, b->arm[side].upper, share);
        out.arm[side].fore = mix_directions(a->arm[side].fore, b->arm[side].fore, share);
    }
    return out;
}

// ---------------------------------------------------------------- stance

static struct quat about_x(double rad) { return quat_from_rotation_vector(v3(rad, 0, 0)); }
static struct quat about_y(double rad) { return quat_from_rotation_vector(v3(0, rad, 0)); }
static struct quat about_z(double rad) { return quat_from_rotation_vector(v3(0, 0, rad)); }

static struct quat quat_of_axes(struct vec3 y, struct vec3 z)
{
    const struct vec3 x = v3_cross(y, z);
    double m[3][3] = {{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}};
    return quat_from_matrix(m);
}

// Directions of a leg, in the axes in which its hip is flexed.
struct leg_directions {
    struct vec3 thigh, shin;
    struct vec3 before; // the shin's front
    struct vec3 front;  // the thigh's
};

static struct leg_directions leg_directions(const struct posture_leg *leg, int side)
{
    const double f = leg->flexed, a = leg->apart, out = side == LEFT ? 1 : -1;
    const struct vec3 thigh = v3(out * sin(a), -sin(f) * cos(a), -cos(f) * cos(a)), swing = v3(0, -cos(f), sin(f));
    // The hip turned outwards turns the knee's hinge about the thigh.
    const struct vec3 front = quat_rotate(quat_from_rotation_vector(v3_scale(thigh, -out * leg->turned)), swing);
    return (struct leg_directions){thigh, v3_sub(v3_scale(thigh, cos(leg->knee)), v3_scale(front, sin(leg->knee))),
                                   v3_add(v3_scale(front, cos(leg->knee)), v3_scale(thigh, sin(leg->knee))), front};
}

// The smallest angle of the knee at which the ankle is `low_m` below the hip; at most 150 degrees.
static double knee_for(const struct physique *physique, struct posture_leg leg, int side, double low_m)
{
    for (leg.knee = 0; leg.knee < 150 * DEGREE; leg.knee += DEGREE) {
        const struct leg_directions to = leg_directions(&leg, side);
        if (physique->thigh_m * to.thigh.z + physique->shin_m * to.shin.z <= -low_m)
            break;
    }
    return leg.knee;
}

static void place_leg(const struct physique *physique, const struct kind *kind, struct posture_leg leg, int side,
                      struct stance *stance)
{
    const struct quat from = kind->flags & LEGS_FROM_VERTICAL ? UNTURNED : stance->pelvis;
    const double sole_m = physique->bind_joint[JOINT_LEFT_FOOT].z, seat_m = 0.062 * physique->figure.height_m;
    if (kind->flags & FEET_ON_SEAT)
        leg.knee = knee_for(physique, leg, side, seat_m - sole_m);
    const struct leg_directions to = leg_directions(&leg, side);
    const int joint = side == LEFT ? JOINT_LEFT_HIP : JOINT_RIGHT_HIP;
    const struct vec3 hip =
        v3_add(stance->waist,
               quat_rotate(stance->pelvis, v3_sub(physique->bind_joint[joint], physique->bind_joint[JOINT_WAIST])));
    const struct vec3 way = v3_add(v3_scale(to.thigh, physique->thigh_m), v3_scale(to.shin, physique->shin_m));
    stance->ankle[side] = v3_add(hip, quat_rotate(from, way));
    stance->knee[side] = quat_rotate(from, v3_add(v3_sub(to.thigh, to.shin), v3_scale(to.front, 0.05)));
    const struct quat foot = quat_of_axes(v3_unit(v3_scale(to.before, -1)), v3_scale(to.shin, -1));
    stance->foot[side] = quat_multiply(from, quat_multiply(foot, about_x(leg.toes)));
    if (kind->flags & FLAT_FEET) {
        const struct vec3 ahead = quat_rotate(from, to.before);
        stance->foot[side] = about_z(atan2(ahead.x, -ahead.y));
    }
}

// Points of the body that touch what is below it: joints with their distance to the skin, tips of the feet, heels.
// Arms only where they carry.
enum { CONTACTS = JOINT_COUNT + 4 };
struct contact {
    struct vec3 at;
    double radius_m;
};

static void contacts_of(const struct physique *physique, const struct kind *kind, const struct stance *stance,
                        struct contact out[CONTACTS])
{
    static const double radius[JOINT_COUNT] = {
        [JOINT_HEAD] = 0.062,       [JOINT_NECK] = 0.035,         [JOINT_TORSO] = 0.03,
        [JOINT_WAIST] = 0.03,       [JOINT_LEFT_SHOULDER] = 0.05, [JOINT_RIGHT_SHOULDER] = 0.05,
        [JOINT_LEFT_ELBOW] = 0.028, [JOINT_RIGHT_ELBOW] = 0.028,  [JOINT_LEFT_HAND] = 0.03,
        [JOINT_RIGHT_HAND] = 0.03,  [JOINT_LEFT_HIP] = 0.062,     [JOINT_RIGHT_HIP] = 0.062,
        [JOINT_LEFT_KNEE] = 0.034,  [JOINT_RIGHT_KNEE] = 0.034,   [JOINT_LEFT_FOOT] = 0.024,
        [JOINT_RIGHT_FOOT] = 0.024,
    };
    struct posed posed;
    physique_pose(physique, stance, &posed);
    const double h = physique->figure.height_m;
    for (int j = 0; j < JOINT_COUNT; j++)
        out[j] = (struct contact){posed.joints.joint[j], radius[j] * h * sqrt(physique->girth)};
    for (int j = JOINT_LEFT_ELBOW; j <= JOINT_RIGHT_HAND && kind->arms == ARMS_FREE; j++)
        if (j != JOINT_RIGHT_SHOULDER)
            out[j].radius_m = -h; // touches nothing
    for (int k = 0; k < 4; k++) { // bind frame, from the ankle: the tip of the foot, the heel
        const int side = k / 2;
        const struct vec3 sole = k % 2 ? v3(0, 0.035 * h, -0.05 * h) : v3(0, -0.105 * h, -0.045 * h);
        const enum joint foot = side == LEFT ? JOINT_LEFT_FOOT : JOINT_RIGHT_FOOT;
        out[JOINT_COUNT + k] =
            (struct contact){v3_add(posed.joints.joint[foot], quat_rotate(stance->foot[side], sole)), 0.006 * h};
    }
}

static void move(struct stance *stance, struct vec3 by)
{
    stance->waist = v3_add(stance->waist, by);
    for (int side = 0; side < 2; side++)
        stance->ankle[side] = v3_add(stance->ankle[side], by);
}

static void rotate_about(struct stance *stance, struct quat rotation, struct vec3 pivot)
{
    stance->waist = v3_add(pivot, quat_rotate(rotation, v3_sub(stance->waist, pivot)));
    stance->pelvis = quat_unit(quat_multiply(rotation, stance->pelvis));
    stance->chest = quat_unit(quat_multiply(rotation, stance->chest));
    stance->head = quat_unit(quat_multiply(rotation, stance->head));
    for (int side = 0; side < 2; side++) {
        stance->upper_arm[side] = quat_rotate(rotation, stance->upper_arm[side]);
        stance->forearm[side] = quat_rotate(rotation, stance->forearm[side]);
        stance->knee[side] = quat_rotate(rotation, stance->knee[side]);
        stance->foot[side] = quat_unit(quat_multiply(rotation, stance->foot[side]));
        stance->ankle[side] = v3_add(pivot, quat_rotate(rotation, v3_sub(stance->ankle[side], pivot)));
    }
}

static double lowest(const struct contact contacts[CONTACTS])
{
    double low = INFINITY;
    for (int k = 0; k < CONTACTS; k++)
        low = fmin(low, contacts[k].at.z - contacts[k].radius_m);
    return low;
}

// Of trunk, head and thighs, about as they weigh.
static struct vec3 centre_of_mass(const struct contact contacts[CONTACTS])
{
    static const struct {
        enum joint joint;
        double weight;
    } parts[] = {{JOINT_HEAD, 0.08},      {JOINT_NECK, 0.1},       {JOINT_TORSO, 0.3},      {JOINT_WAIST, 0.2},
                 {JOINT_LEFT_HIP, 0.05},  {JOINT_RIGHT_HIP, 0.05}, {JOINT_LEFT_KNEE, 0.08}, {JOINT_RIGHT_KNEE, 0.08},
                 {JOINT_LEFT_FOOT, 0.03}, {JOINT_RIGHT_FOOT, 0.03}};
    struct vec3 sum = {0, 0, 0};
    for (size_t k = 0; k < COUNT_OF(parts); k++)
        sum = v3_add(sum, v3_scale(contacts[parts[k].joint].at, parts[k].weight));
    return sum;
}

// A rigid body that falls over the farthest of what supports it, by a small angle at a time, until its centre of mass
// is above the polygon of what touches the floor.
static void settle(const struct physique *physique, const struct kind *kind, struct stance *stance)
{
    enum { STEPS = 260 };
    const double step = 0.6 * DEGREE, touching_m = 0.012, spare_m = 0.02;
    for (int n = 0; n < STEPS; n++) {
        struct contact contacts[CONTACTS];
        contacts_of(physique, kind, stance, contacts);
        const double low = lowest(contacts);
        const struct vec3 mass = centre_of_mass(contacts);
        struct vec3 middle = {0, 0, 0};
        int count = 0;
        for (int k = 0; k < CONTACTS; k++)
            if (contacts[k].at.z - contacts[k].radius_m < low + touching_m) {
                middle = v3_add(middle, contacts[k].at);
                count++;
            }
        middle = v3_scale(middle, 1.0 / count);
        struct vec3 way = v3_sub(mass, middle), pivot = middle;
        way.z = 0;
        const double away_m = v3_length(way);
        double reach_m = 0;
        for (int k = 0; k < CONTACTS && away_m > 0; k++) {
            const double along = v3_dot(v3_sub(contacts[k].at, middle), way) / away_m;
            if (contacts[k].at.z - contacts[k].radius_m < low + touching_m && along > reach_m) {
                reach_m = along;
                pivot = contacts[k].at;
            }
        }
        move(stance, v3(0, 0, -low));
        if (away_m < reach_m + spare_m)
            return;
        pivot.z = 0;
        rotate_about(
            stance, quat_from_rotation_vector(v3_scale(v3_cross(v3(0, 0, 1), v3_scale(way, 1 / away_m)), step)), pivot);
    }
}

// A direction that leads from that height no lower than to `floor_m`, near the given one, rather outwards.
static struct vec3 above_floor(struct vec3 direction, double from_m, double length_m, double floor_m, struct vec3 out)
{
    const double min_z = fmin(0.95, (floor_m - from_m) / length_m);
    if (direction.z >= min_z)
        return direction;
    const double rise = fmin(1, min_z - direction.z); // the more, the farther outwards
    const double x = direction.x + rise * out.x, y = direction.y + rise * out.y, flat = fmax(1e-6, hypot(x, y)),
                 wanted = sqrt(fmax(0, 1 - min_z * min_z));
    return v3(x / flat * wanted, y / flat * wanted, min_z);
}

// Arms that carry nothing lie on the floor, not in it.
static void lay_arms(const struct physique *physique, struct stance *stance)
{
    struct posed posed;
    const double skin_m = 0.025 * physique->figure.height_m, hand_m = 0.022 * physique->figure.height_m;
    physique_pose(physique, stance, &posed);
    for (int side = 0; side < 2; side++) {
        const struct vec3 out = quat_rotate(stance->chest, v3(side == LEFT ? 1 : -1, -0.3, 0.3));
        const double shoulder = posed.joints.joint[side == LEFT ? JOINT_LEFT_SHOULDER : JOINT_RIGHT_SHOULDER].z;
        stance->upper_arm[side] = above_floor(stance->upper_arm[side], shoulder, physique->upper_arm_m, skin_m, out);
        const double elbow = shoulder + physique->upper_arm_m * stance->upper_arm[side].z;
        stance->forearm[side] = above_floor(stance->forearm[side], elbow, physique->forearm_m + hand_m, skin_m, out);
    }
}

// second: the leg that does not carry, where the two differ.
static struct vec3 anchor(const struct kind *kind, double second, const struct contact contacts[CONTACTS])
{
    enum joint left = JOINT_LEFT_FOOT, right = JOINT_RIGHT_FOOT;
    if (kind->flags & ON_KNEES)
        left = JOINT_LEFT_KNEE, right = JOINT_RIGHT_KNEE;
    if (kind->flags & ON_PELVIS)
        left = JOINT_LEFT_HIP, right = JOINT_RIGHT_HIP;
    const struct vec3 l = contacts[left].at, r = contacts[right].at;
    const double weight = kind->differs ? 1 - second : 0.5;
    return v3_mix(l, r, weight);
}

struct stance posture_stance(enum posture posture, const struct posture_pose *pose, const struct physique *physique)
{
    const struct kind *kind = &kinds[posture];
    struct stance s = {.waist = {0, 0, physique->bind_joint[JOINT_WAIST].z}};
    s.pelvis = quat_multiply(about_x(pose->pitch), about_y(pose->roll));
    s.chest =
        quat_multiply(s.pelvis, quat_multiply(about_x(pose->chest_pitch),
                                              quat_multiply(about_y(pose->chest_roll), about_z(pose->chest_yaw))));
    s.head = quat_multiply(s.chest, quat_multiply(about_x(pose->head_pitch), about_z(pose->head_yaw)));
    const struct quat arms = kind->arms == ARMS_PROP ? UNTURNED : s.chest;
    for (int side = 0; side < 2; side++) {
        const double out = side == LEFT ? 1 : -1;
        const struct vec3 u = pose->arm[side].upper, f = pose->arm[side].fore;
        s.upper_arm[side] = quat_rotate(arms, v3(out * u.x, u.y, u.z));
        s.forearm[side] = quat_rotate(arms, v3(out * f.x, f.y, f.z));
        place_leg(physique, kind, pose->leg[side], side, &s);
    }
    if (kind->flags & SETTLES)
        settle(physique, kind, &s);
    struct contact contacts[CONTACTS];
    contacts_of(physique, kind, &s, contacts);
    const struct vec3 at = anchor(kind, pose->second, contacts);
    move(&s, v3(-at.x, -at.y, -lowest(contacts)));
    if (kind->arms == ARMS_FREE)
        lay_arms(physique, &s);
    return s;
}

// ---------------------------------------------------------------- furniture

int posture_furniture(enum posture posture, const struct stance *stance, const struct physique *physique,
                      struct posture_box out[POSTURE_BOXES])
{
    if (posture != POSTURE_SITTING && posture != POSTURE_WHEELCHAIR)
        return 0;
    struct contact contacts[CONTACTS];
    contacts_of(physique, &kinds[posture], stance, contacts);
    const double h = physique->figure.height_m, wide = 0.15 * h * sqrt(physique->girth), thick = 0.04;
    const struct contact *hip = &contacts[JOINT_LEFT_HIP];
    const struct vec3 middle = v3_mix(hip->at, contacts[JOINT_RIGHT_HIP].at, 0.5);
    const double top = fmin(hip->at.z, contacts[JOINT_RIGHT_HIP].at.z) - hip->radius_m - 0.01,
                 back = middle.y + 0.13 * h;
    out[0] =
        (struct posture_box){v3(middle.x - wide, middle.y - 0.16 * h, top - thick), v3(middle.x + wide, back, top)};
    out[1] =
        (struct posture_box){v3(middle.x - wide, back, top - thick), v3(middle.x + wide, back + thick, top + 0.25 * h)};
    for (int k = 0; k < 2; k++) {
        const double x = middle.x + (k ? 1 : -1) * (wide + 0.03);
        const bool wheels = posture == POSTURE_WHEELCHAIR;
        out[2 + k] =
            wheels ? (struct posture_box){v3(x - 0.02, middle.y - 0.25, 0), v3(x + 0.02, middle.y + 0.35, top + 0.15)}
                   : (struct posture_box){v3(x - 0.05, back - 0.05, 0), v3(x - 0.01, back, top)}; // legs of a chair
    }
    return POSTURE_BOXES;
}

// ---------------------------------------------------------------- motion

static const double KEY_S = 1; // from pose to pose

struct posture_motion posture_motion_draw(enum posture posture, uint64_t seed)
{
    struct posture_motion out = {.posture = posture};
    struct rng rng = rng_of(seed, (int)posture);
    const bool swapped = rng_uniform(&rng) < 0.5;
    for (int k = 0; k < POSTURE_KEYS; k++) {
        const struct posture_pose next = posture_draw(posture, swapped, &rng);
        const double far = rng_between(&rng, 0.3, 0.8);
        out.key[k] = k ? posture_mix(&out.key[k - 1], &next, far) : next;
    }
    return out;
}

double posture_motion_seconds(void) { return (POSTURE_KEYS - 1) * KEY_S; }

struct stance posture_motion_at(const struct posture_motion *motion, const struct physique *physique, double time_s)
{
    const double at = fmin(fmax(time_s, 0), posture_motion_seconds()) / KEY_S;
    const int first = (int)fmin(at, POSTURE_KEYS - 2);
    const double t = at - first, share = t * t * (3 - 2 * t);
    const struct posture_pose pose = posture_mix(&motion->key[first], &motion->key[first + 1], share);
    return posture_stance(motion->posture, &pose, physique);
}
