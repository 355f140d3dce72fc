// The figure's clothes, skin and face, painted by position in the bind pose, for a height of 1.75 m. Front and back,
// left and right all differ, so that an image shows which is which. Shapes and colours are chosen by hand.
#include "tests/world/figure.h"
#include "tests/world/glyphs.h"
#include "tests/world/numbers.h"
#include "tests/world/rgb.h"
#include "tests/world/texture.h"

#include <string.h>

struct palette {
    uint32_t shirt, accent, number, trousers, shoes, skin, hair, eyes;
};

static const struct palette palettes[5] = {
    {0xc8402f, 0xf4efe6, 0xf7f3ea, 0x2f4463, 0xe8e4dc, 0xe3b08f, 0x3a2416, 0x3f6b4a},
    {0x2a6f97, 0xf2c14e, 0xf7f3ea, 0x4a4238, 0x7a4a2b, 0xcf9873, 0x1c1714, 0x4a3322},
    {0xf0b429, 0x1f4e79, 0x16324f, 0x3d6b52, 0xb5342d, 0xf0c8a8, 0x9a6a34, 0x4f83b5},
    {0x3f5d4e, 0xe6dcc6, 0xf1e9d8, 0x5b4a3c, 0x2b2622, 0xa8714b, 0x15110f, 0x2f1f15},
    {0x6a4c93, 0x8ac926, 0xf5f0e6, 0x26282e, 0xd9d4ca, 0x7a4d31, 0x120e0c, 0x2a1a10},
};

// 1 inside (negative distance), 0 outside, over a ramp of 1.5 mm.
static float in(float distance) { return minf(1, maxf(0, 0.5f - distance / 0.0015f)); }

struct wear {
    const struct physique *p;
    const struct palette *c;
    float k;         // scale to 1.75 m
    struct vec3f at; // the point at that scale
    float shine;
};

static struct vec3f joint(const struct wear *w, enum joint j)
{
    struct vec3 v = w->p->bind_joint[j];
    return (struct vec3f){(float)v.x * w->k, (float)v.y * w->k, (float)v.z * w->k};
}

// ---------------------------------------------------------------- head

static struct rgb face(const struct wear *w, struct vec3f q, struct rgb skin)
{
    bool woman = w->p->figure.woman;
    struct rgb c = skin;
    float side = fabsf(q.x);
    // cheeks and the nose's shadow
    c = mix(c, hex(0xd96a55),
            0.30f * expf(-((side - 0.042f) * (side - 0.042f) + (q.z + 0.025f) * (q.z + 0.025f)) / 0.0003f));
    if (q.y > -0.01f)
        return c;
    // eyes: white, iris, pupil, glint, lid
    float ex = side - 0.031f, ez = q.z - 0.012f, curve = ez + 9.0f * ex * ex;
    float opening = maxf(fabsf(ex) - 0.0155f, fabsf(curve - 0.0015f) - 0.0075f);
    c = mix(c, dim(skin, 0.62f), in(opening - 0.003f));
    struct rgb eye = hex(0xf4f1ec);
    float r = sqrtf(ex * ex + ez * ez);
    eye = mix(eye, hex(w->c->eyes), in(r - 0.0075f));
    eye = mix(eye, hex(0x0a0807), in(r - 0.0038f));
    eye = mix(eye, hex(0xffffff), in(hypotf(q.x - (q.x > 0 ? 0.033f : -0.029f), ez - 0.003f) - 0.0015f));
    c = mix(c, eye, in(opening));
    float lid = maxf(fabsf(ex) - 0.017f, fabsf(curve - 0.0095f) - (woman ? 0.0022f : 0.0014f));
    c = mix(c, hex(0x1a1210), in(lid));
    // brows
    float brow =
        maxf(fabsf(ex - 0.002f) - 0.019f, fabsf(q.z - 0.035f + 7 * ex * ex + 0.05f * ex) - (woman ? 0.0022f : 0.0036f));
    c = mix(c, dim(hex(w->c->hair), 0.8f), 0.9f * in(brow));
    // nostrils, mouth
    c = mix(c, dim(skin, 0.35f), 0.8f * in(hypotf(side - 0.0065f, 1.4f * (q.z + 0.030f)) - 0.0034f));
    float mz = q.z + 0.056f - 6.0f * q.x * q.x;
    float lips = maxf(side - 0.0245f, fabsf(mz) - 0.0075f * (1 - side / 0.03f) - 0.001f);
    c = mix(c, woman ? hex(0xb53a3f) : mix(skin, hex(0x9c3b35), 0.6f), in(lips));
    c = mix(c, hex(0x4a1614), in(maxf(side - 0.024f, fabsf(mz) - 0.0011f)));
    if (!woman && w->p->figure.height_m > 1.5) { // a shaven chin's shadow
        float beard = (1 - in(lips)) * minf(1, maxf(0, (-0.035f - q.z) * 40));
        c = mix(c, hex(w->c->hair), 0.22f * beard * (0.7f + 0.6f * noise2(q.x * 600, q.z * 600, 3)));
    }
    return c;
}

static struct rgb head(struct wear *w)
{
    struct vec3f h = joint(w, JOINT_HEAD), q = {w->at.x - h.x, w->at.y - h.y, w->at.z - h.z};
    float big = 1 + 0.28f * maxf(0, 1 - 1 / w->k); // as shapes.c makes a child's head
    q.x /= big, q.y /= big, q.z /= big;
    bool woman = w->p->figure.woman;
    struct rgb skin = dim(hex(w->c->skin), 0.97f + 0.06f * noise3(q.x * 90, q.y * 90, q.z * 90, 5));
    float hair = ellipsoid_distance(head_hair, q);
    if (woman)
        hair = minf(hair, ellipsoid_distance(head_long_hair, q));
    bool front = q.y < -0.02f && q.z < 0.062f + 0.3f * q.x * (woman ? 1.0f : 0.0f) && fabsf(q.x) < 0.062f;
    float edge = hair - 0.004f + 0.0015f * (noise2(q.x * 500, q.z * 90, 8) - 0.5f);
    if (!front && edge < 0) {
        w->shine = 0.35f;
        float strand = noise3(atan2f(q.x, q.y + 0.02f) * 26, q.z * 9, q.y * 6, 21);
        float fine = noise3(atan2f(q.x, q.y + 0.02f) * 90, q.z * 16, 0, 22);
        return dim(hex(w->c->hair), 0.55f + 0.6f * strand + 0.5f * fine);
    }
    w->shine = 0.18f;
    return face(w, q, skin);
}

// ---------------------------------------------------------------- clothes

static float weave(const struct wear *w, float size, uint32_t seed)
{
    return 0.90f + 0.20f * noise3(w->at.x * size, w->at.y * size, w->at.z * size, seed);
}

// A number in its natural width, its digits `tall` metres high, centred on (0, z).
static float number_distance(int number, float x, float z, float tall)
{
    char text[3] = {(char)('0' + number / 10), (char)('0' + number % 10), 0};
    const char *shown = number < 10 ? text + 1 : text;
    float s = tall / 6;
    return s * (text_distance(shown, x / s + text_width(shown) / 2, z / s + 3) - 0.72f);
}

static struct rgb trunk(struct wear *w)
{
    struct vec3f p = w->at, neck = joint(w, JOINT_NECK), torso = joint(w, JOINT_TORSO);
    const struct palette *c = w->c;
    struct rgb cloth = hex(c->shirt);
    bool front = p.y < neck.y, coat = w->p->figure.clothes == CLOTHES_COAT;
    w->shine = 0.05f;
    float z = p.z - torso.z;
    if (coat) {
        cloth = dim(cloth, 1 - 0.18f * in(fabsf(fmodf(fabsf(p.x) + 0.02f, 0.08f) - 0.04f) - 0.004f));
        cloth = dim(cloth, 1 - 0.18f * in(fabsf(fmodf(p.z, 0.08f) - 0.04f) - 0.004f));
        if (front) { // lapels with a scarf between them, buttons below
            float open = fabsf(p.x) - maxf(0, 0.30f * (z + 0.02f));
            cloth = mix(cloth, dim(cloth, 0.55f), in(fabsf(open - 0.035f) - 0.004f));
            cloth = mix(cloth, hex(c->accent), in(open));
            cloth = mix(cloth, dim(hex(c->shirt), 0.3f), in(maxf(fabsf(p.x) - 0.002f, z + 0.02f)));
            float button = hypotf(p.x - 0.028f, fmodf(p.z, 0.11f) - 0.055f);
            if (z < 0)
                cloth = mix(cloth, hex(c->number), in(button - 0.011f));
        } else {
            cloth = mix(cloth, dim(cloth, 0.45f), in(fabsf(p.x) - 0.0015f));
            cloth = mix(cloth, hex(c->accent), in(fabsf(z + 0.20f) - 0.022f)); // a half-belt
        }
    } else if (front) {
        cloth = mix(cloth, hex(c->accent), in(fabsf(z + 0.075f) - 0.015f));
        cloth = mix(cloth, hex(c->number), in(number_distance(w->p->figure.number, p.x, z - 0.060f, 0.110f)));
    } else {
        cloth =
            mix(cloth, hex(c->number), in(number_distance((w->p->figure.number + 10) % 100, -p.x, z - 0.000f, 0.175f)));
        float s = 0.0062f;
        cloth = mix(cloth, hex(c->accent),
                    in(s * (text_distance("REENACT", -p.x / s + text_width("REENACT") / 2, (z - 0.128f) / s) - 0.75f)));
    }
    cloth = dim(cloth, weave(w, 240, 31));
    // the neckline
    float collar =
        hypotf(p.x * 0.92f, p.y - neck.y) * (front ? 0.92f : 1) - 0.070f - 0.10f * maxf(0, neck.z + 0.02f - p.z);
    collar = maxf(collar, neck.z - (front ? 0.085f : 0.006f) - p.z);
    if (!coat && p.z > neck.z - 0.11f) {
        struct rgb skin = hex(c->skin);
        cloth = mix(cloth, dim(hex(c->accent), 0.9f), in(collar - 0.012f));
        cloth = mix(cloth, skin, in(collar));
    }
    return cloth;
}

static struct rgb legs(struct wear *w)
{
    struct vec3f p = w->at, waist = joint(w, JOINT_WAIST), ankle = joint(w, JOINT_LEFT_FOOT),
                 knee = joint(w, JOINT_LEFT_KNEE);
    const struct palette *c = w->c;
    enum world_clothes clothes = w->p->figure.clothes;
    bool front = p.y < waist.y;
    float side = fabsf(p.x);
    w->shine = 0.04f;
    if (p.z < ankle.z - 0.006f || (p.z < ankle.z + 0.03f && clothes == CLOTHES_SKIRT)) { // shoes
        w->shine = 0.30f;
        struct rgb shoe =
            mix(hex(c->shoes), hex(c->accent), 0.8f * in(fabsf(p.y - ankle.y + 0.045f + 0.4f * p.z) - 0.010f));
        shoe = mix(shoe, hex(0x2a2622),
                   in(maxf(fabsf(fmodf(p.y + 1, 0.018f) - 0.009f) - 0.0025f,
                           maxf(fabsf(side - ankle.x) - 0.018f, p.y - ankle.y + 0.03f))));
        return mix(shoe, hex(0xf2efe8), in(p.z - 0.018f));
    }
    if (clothes == CLOTHES_SKIRT && p.z < knee.z + 0.083f) {
        w->shine = 0.15f;
        struct rgb skin = dim(hex(c->skin), 0.96f + 0.08f * noise3(p.x * 60, p.y * 60, p.z * 60, 6));
        return mix(skin, hex(0xf2efe8), in(p.z - ankle.z - 0.075f)); // socks
    }
    struct rgb cloth =
        dim(hex(c->trousers), weave(w, 320, 33) * (0.88f + 0.24f * noise3(p.x * 14, p.y * 14, p.z * 10, 34)));
    if (clothes == CLOTHES_SKIRT) {
        float a = atan2f(p.x, -p.y) * 10;
        cloth = dim(hex(c->trousers), 0.85f + 0.25f * fabsf(sinf(a)));
        cloth = mix(cloth, hex(c->accent), in(fabsf(p.z - knee.z - 0.125f) - 0.014f));
        if (front) { // dots in front, a zip behind
            float dx = fmodf(side + 0.03f, 0.06f) - 0.03f, dz = fmodf(p.z, 0.06f) - 0.03f;
            cloth = mix(cloth, hex(c->accent), in(hypotf(dx, dz) - 0.008f));
        } else {
            cloth = mix(cloth, hex(0xb8b2a6), in(maxf(fabsf(p.x) - 0.003f, waist.z - 0.15f - p.z)));
        }
        return cloth;
    }
    // outer seam: a double white stripe on the left leg, a plain seam on the right
    float y = p.y - waist.y;
    bool outer = side > joint(w, JOINT_LEFT_HIP).x + 0.02f || p.z < knee.z;
    outer = outer && side > ankle.x + 0.028f;
    if (outer && p.x > 0)
        cloth = mix(cloth, hex(0xf2efe8), in(fabsf(fabsf(y) - 0.013f) - 0.006f));
    if (outer && p.x < 0)
        cloth = dim(cloth, 1 - 0.5f * in(fabsf(y) - 0.002f));
    if (front) {
        cloth = dim(cloth, 1 - 0.45f * in(maxf(fabsf(p.x - 0.006f) - 0.0018f, waist.z - 0.11f - p.z))); // fly
        if (p.x < 0) // a patch on the right knee
            cloth = mix(cloth, hex(c->accent), in(maxf(fabsf(side - 0.075f), fabsf(p.z - knee.z - 0.01f)) - 0.040f));
    } else {
        float pocket = maxf(fabsf(side - 0.075f) - 0.052f, fabsf(p.z - waist.z + 0.095f) - 0.055f);
        cloth = dim(cloth, 1 - 0.45f * in(fabsf(pocket) - 0.002f));
        cloth = dim(cloth, 1 - 0.4f * in(maxf(fabsf(p.x) - 0.0015f, waist.z - 0.2f - p.z)));
    }
    float hem = waist.z - 0.024f; // belt
    cloth = mix(cloth, hex(0x3b2416), in(fabsf(p.z - hem) - 0.018f));
    return mix(cloth, hex(0xd8c06a), front ? in(maxf(fabsf(p.x) - 0.024f, fabsf(p.z - hem) - 0.014f)) : 0);
}

static struct rgb arm(struct wear *w, float along)
{
    const struct palette *c = w->c;
    bool left = w->at.x > 0, coat = w->p->figure.clothes == CLOTHES_COAT;
    float upper = (float)w->p->upper_arm_m * w->k, fore = (float)w->p->forearm_m * w->k;
    float end = coat ? upper + 0.965f * fore : 0.662f * upper;
    w->shine = 0.05f;
    if (along > end) {
        w->shine = 0.16f;
        struct rgb skin = dim(hex(c->skin), 0.96f + 0.08f * noise3(w->at.x * 70, w->at.y * 70, w->at.z * 70, 7));
        if (!left) // a wristwatch on the right
            skin = mix(skin, hex(0x1d1d20), in(fabsf(along - upper - fore + 0.012f) - 0.011f));
        float tip = along - upper - fore;
        return mix(skin, hex(0xd98f7f), 0.35f * minf(1, maxf(0, tip * 12 - 1)));
    }
    struct rgb cloth = hex(c->shirt);
    if (left) { // rings on the left sleeve, a plain cuff on the right
        float ring = fabsf(fmodf(along - (coat ? upper : 0.05f) + 1.0f, 0.042f) - 0.021f);
        if (along > (coat ? upper + 0.02f : 0.05f))
            cloth = mix(cloth, hex(c->accent), in(ring - 0.0075f));
    } else {
        cloth = mix(cloth, hex(c->accent), in(end - 0.035f - along));
    }
    return dim(cloth, weave(w, 240, 31));
}

float figure_albedo(const struct physique *p, struct vec3f bind_point, float albedo[3])
{
    float k = 1.75f / (float)p->figure.height_m;
    struct wear w = {p, &palettes[p->figure.palette], k, {bind_point.x * k, bind_point.y * k, bind_point.z * k}, 0};
    struct vec3f neck = joint(&w, JOINT_NECK), shoulder = joint(&w, JOINT_LEFT_SHOULDER),
                 waist = joint(&w, JOINT_WAIST);
    float side = fabsf(w.at.x);
    float along = (side - shoulder.x) * (float)p->arm.x + (w.at.z - shoulder.z) * (float)p->arm.z;
    float off =
        hypotf((side - shoulder.x) * (float)p->arm.z - (w.at.z - shoulder.z) * (float)p->arm.x, w.at.y - shoulder.y);
    struct rgb c;
    if (along > 0.02f && off < 0.11f && side > shoulder.x - 0.02f)
        c = arm(&w, along);
    else if (w.at.z > neck.z + 0.055f)
        c = head(&w);
    else if (w.at.z > waist.z - 0.005f || p->figure.clothes == CLOTHES_COAT) {
        bool tail = p->figure.clothes != CLOTHES_COAT || w.at.z > joint(&w, JOINT_LEFT_KNEE).z + 0.016f;
        c = tail ? trunk(&w) : legs(&w);
    } else
        c = legs(&w);
    albedo[0] = 0.95f * c.r;
    albedo[1] = 0.95f * c.g;
    albedo[2] = 0.95f * c.b;
    return w.shine;
}
