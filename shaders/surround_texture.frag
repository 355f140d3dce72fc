#version 300 es
// View-dependent texture, as surround_view.c: a pixel's colour from the two pictures that saw its point from the smallest
// angle, sharp and unoccluded, with weights that fade out before a picture leaves the blend (Buehler et al. 2001,
// section 4). Looked for among the picture that gave the geometry and the three that would be best of the others if
// nothing hid the point.
precision highp float;
precision highp int;
precision highp sampler2DArray;

uniform highp sampler2D surface;
uniform sampler2DArray colors;
uniform sampler2DArray depths; // inverse distances; negative: not known

uniform vec4 view_lens; // fx, fy, cx, cy
// 1: what no picture has seen is hatched, else black; radians of the view's pixel; radians that half the resolution costs;
// nearest z drawn.
uniform vec4 look;

out vec4 color; // alpha 0: no picture has seen what is there

#include "surround_picture.glsl"
#include "surround_depth.glsl"

const float HIDDEN = 1e9;

// near: length of `along`.
float cost_of(vec3 turned, vec3 q, float near)
{
    float far2 = dot(q, q) + 1e-18, per_far = inversesqrt(far2) / near;
    float chord2 = max(2.0 - 2.0 * dot(turned, q) * per_far, 0.0);
    float angle = sqrt(chord2) * (1.0 + chord2 * (1.0 / 24.0 + chord2 * (3.0 / 640.0))); // 2 asin(chord / 2)
    return angle + look.z * max(camera[0].y / look.y * far2 * per_far - 0.5, 0.0);
}

// Whether a picture's depth is that of the point it would see there.
bool is_seen(int i, vec2 at, float wanted)
{
    vec2 uv = (at + 0.5) / vec2(textureSize(depths, 0).xy);
    return abs(textureLod(depths, vec3(uv, float(layer_of(i))), 0.0).r - wanted) <= 0.04 * wanted + 2e-4;
}

vec3 color_of(int i, vec2 at)
{
    vec4 gain = pictures[4 * i + 3];
    vec2 uv = (at + 0.5) / vec2(textureSize(colors, 0).xy);
    return min(textureLod(colors, vec3(uv, gain.w), 0.0).rgb * gain.rgb, 1.0);
}

vec3 along;       // the pixel's ray, z = 1
float inverse_z;
struct choice {
    float cost;
    int picture;
    vec3 q; // the direction to the point in the picture's axes
};

float best, second, third; // costs
int best_picture, second_picture;
vec2 best_at, second_at;

void offer(choice c, bool made_geometry)
{
    vec2 at = pixel_of(c.q);
    float cost = made_geometry || is_seen(c.picture, at, inverse_z * inversesqrt(dot(c.q, c.q))) ? c.cost : HIDDEN;
    bool before = cost < best, between = cost < second;
    third = min(third, max(cost, second));
    second = before ? best : between ? cost : second;
    second_picture = before ? best_picture : between ? c.picture : second_picture;
    second_at = before ? best_at : between ? at : second_at;
    best = before ? cost : best;
    best_picture = before ? c.picture : best_picture;
    best_at = before ? at : best_at;
}

// The picture that made the geometry, and the others of least cost wherever something hides the point.
choice own, a, b, c;

void consider(int i, int first, float near)
{
    vec3 turned, q = in_picture(i, along, inverse_z, turned);
    float cost = in_frame(i, q) ? cost_of(turned, q, near) : HIDDEN;
    bool is_own = i == first;
    own.cost = is_own ? cost : own.cost;
    own.picture = is_own ? i : own.picture;
    own.q = is_own ? q : own.q;
    cost = is_own ? HIDDEN : cost;
    bool to_a = cost < a.cost, to_b = cost < b.cost, to_c = cost < c.cost;
    c.cost = to_b ? b.cost : to_c ? cost : c.cost;
    c.picture = to_b ? b.picture : to_c ? i : c.picture;
    c.q = to_b ? b.q : to_c ? q : c.q;
    b.cost = to_a ? a.cost : to_b ? cost : b.cost;
    b.picture = to_a ? a.picture : to_b ? i : b.picture;
    b.q = to_a ? a.q : to_b ? q : b.q;
    a.cost = to_a ? cost : a.cost;
    a.picture = to_a ? i : a.picture;
    a.q = to_a ? q : a.q;
}
#define FOR_EACH(i) consider(i, first, near);

void choose(int first)
{
    float near = length(along);
    own = a = b = c = choice(HIDDEN, 0, vec3(0.0, 0.0, 1.0));
    FOR_EACH_PICTURE
    best = second = third = HIDDEN;
    offer(own, true);
    offer(a, false);
    offer(b, false);
    offer(c, false);
}

// Grey with slanting stripes, opaque when drawn over black: not to be taken for a picture.
vec4 hatched(ivec2 at)
{
    float grey = (at.x + at.y) / 6 % 2 == 1 ? 96.0 : 128.0;
    return vec4(vec3(look.x * grey / 255.0), 0.0);
}

void main()
{
    ivec2 at = ivec2(gl_FragCoord.xy);
    vec4 kept = texelFetch(surface, at, 0);
    int first = int(kept.a * 255.0 + 0.5) - 1;
    color = hatched(at);
    if (first < 0)
        return;
    inverse_z = unpack_inverse_z(kept, look.w);
    along = vec3((vec2(at) - view_lens.zw) / view_lens.xy, 1.0);
    choose(first);
    if (best >= HIDDEN)
        return;
    bool two = second < HIDDEN;
    // The cost at which a picture's weight is 0: that of the next one
    float end = third < HIDDEN ? third : 1.5 * (two ? second : best) + 0.02;
    vec2 costs = vec2(best, second), weight = max(1.0 - costs / (end + 1e-6), 0.001) / (costs + 0.02);
    vec3 sum = color_of(best_picture, best_at);
    if (two)
        sum = mix(sum, color_of(second_picture, second_at), weight.y / (weight.x + weight.y));
    color = vec4(sum, 1.0);
}
