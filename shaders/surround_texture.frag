#version 300 es
// View-dependent texture, as view_texture.c: a pixel's colour from the two pictures that saw its point from the smallest
// angle, sharp and unoccluded, with weights that fade out before a picture leaves the blend (Buehler et al. 2001,
// section 4). Looked for among the four that are best without regard to occlusion and the one that gave the geometry.
precision highp float;
precision highp int;
precision highp sampler2DArray;

uniform highp sampler2D surface;
uniform sampler2DArray colors;
uniform sampler2DArray depths; // inverse distances; negative: not known

uniform vec4 view_lens; // fx, fy, cx, cy
uniform vec4 look;      // pictures; radians of the view's pixel; radians that half the resolution costs; nearest z drawn
uniform vec4 unseen;    // 1: what nobody has seen is hatched, else black

out vec4 color; // alpha 0: nobody has seen what is there

#include "surround_picture.glsl"
#include "surround_depth.glsl"

const float HIDDEN = 1e9, LAST_RESORT = 100.0;

float cost_of(int i, vec3 turned, vec3 q)
{
    float near = length(turned), far = length(q) + 1e-9;
    float chord = length(turned / near - q / far), chord2 = chord * chord;
    float angle = chord * (1.0 + chord2 * (1.0 / 24.0 + chord2 * (3.0 / 640.0))); // 2 asin(chord / 2)
    float coarse = pictures[6 * i + 3].y * far / (look.y * near);
    return angle + look.z * max(coarse - 0.5, 0.0);
}

// How much of the 2 x 2 pixels around a point are of the point's surface.
float share_seen(int i, vec2 at, float wanted)
{
    ivec2 size = ivec2(pictures[6 * i + 3].zw), low = ivec2(floor(at)), high = low + 1;
    vec2 t = at - vec2(low);
    ivec2 first = clamp(low, ivec2(0), size - 1), last = clamp(high, ivec2(0), size - 1);
    if (is_panorama(i)) {
        first.x = low.x < 0 ? size.x - 1 : low.x;
        last.x = high.x >= size.x ? 0 : high.x;
    }
    int layer = layer_of(i);
    vec4 seen = vec4(texelFetch(depths, ivec3(first, layer), 0).r,
                     texelFetch(depths, ivec3(last.x, first.y, layer), 0).r,
                     texelFetch(depths, ivec3(first.x, last.y, layer), 0).r,
                     texelFetch(depths, ivec3(last, layer), 0).r);
    vec4 is = step(abs(seen - wanted), vec4(0.04 * wanted + 2e-4));
    return mix(mix(is.x, is.y, t.x), mix(is.z, is.w, t.x), t.y);
}

vec3 color_of(int i, vec2 at)
{
    vec4 gain = pictures[6 * i + 5];
    vec2 uv = (at + 0.5) / vec2(textureSize(colors, 0).xy);
    return min(textureLod(colors, vec3(uv, gain.w), 0.0).rgb * gain.rgb, 1.0);
}

vec3 along;                                    // the pixel's ray, z = 1
float inverse_z;
vec3 best = vec3(HIDDEN);                      // costs
ivec3 chosen = ivec3(-1);
vec2 best_at = vec2(0.0), second_at = vec2(0.0);

void offer(int i, bool made_geometry)
{
    if (i < 0)
        return;
    vec3 turned, q = in_picture(i, along, inverse_z, turned);
    if (!in_frame(i, q))
        return;
    vec2 at = pixel_of(i, q);
    float seen = share_seen(i, at, inverse_z / length(q));
    float cost = cost_of(i, turned, q) + (seen >= 0.5 ? 0.3 * (1.0 - seen) : made_geometry ? LAST_RESORT : HIDDEN);
    if (cost < best.x) {
        best = vec3(cost, best.xy);
        chosen = ivec3(i, chosen.xy);
        second_at = best_at;
        best_at = at;
    } else if (cost < best.y) {
        best = vec3(best.x, cost, best.y);
        chosen = ivec3(chosen.x, i, chosen.y);
        second_at = at;
    } else
        best.z = min(best.z, cost);
}

// The four pictures of least cost, wherever something hides the point.
ivec4 candidates(int but)
{
    vec4 c = vec4(HIDDEN);
    ivec4 id = ivec4(-1);
    for (int i = 0; i < int(look.x); i++) {
        vec3 turned, q = in_picture(i, along, inverse_z, turned);
        float cost = i != but && in_frame(i, q) ? cost_of(i, turned, q) : HIDDEN;
        bvec4 before = lessThan(vec4(cost), c);
        c = vec4(before.x ? cost : c.x, before.x ? c.x : before.y ? cost : c.y,
                 before.y ? c.y : before.z ? cost : c.z, before.z ? c.z : before.w ? cost : c.w);
        id = ivec4(before.x ? i : id.x, before.x ? id.x : before.y ? i : id.y,
                   before.y ? id.y : before.z ? i : id.z, before.z ? id.z : before.w ? i : id.w);
    }
    return id;
}

// Grey with slanting stripes, opaque when drawn over black: not to be taken for a picture.
vec4 hatched(ivec2 at)
{
    float grey = (at.x + at.y) / 6 % 2 == 1 ? 96.0 : 128.0;
    return vec4(vec3(unseen.x * grey / 255.0), 0.0);
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
    ivec4 others = candidates(first);
    offer(first, true);
    offer(others.x, false);
    offer(others.y, false);
    offer(others.z, false);
    offer(others.w, false);
    if (best.x >= HIDDEN)
        return;
    bool two = best.y < LAST_RESORT;
    // The cost at which a picture's weight is 0: that of the next one
    float end = best.z < LAST_RESORT ? best.z : 1.5 * (two ? best.y : best.x) + 0.02;
    vec2 weight = max(1.0 - best.xy / (end + 1e-6), 0.001) / (best.xy + 0.02);
    vec3 sum = color_of(chosen.x, best_at);
    if (two)
        sum = mix(sum, color_of(chosen.y, second_at), weight.y / (weight.x + weight.y));
    color = vec4(sum, 1.0);
}
