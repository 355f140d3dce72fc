#version 300 es
// Vertex of a picture's surface: view-dependent geometry, and the view-dependent depth test (Okura 2014, section 3.4;
// paper 003, equation 1) at the vertex: what other pictures look through is drawn behind all that they do not.
precision highp float;
precision highp int;
precision highp sampler2DArray;

layout(location = 0) in vec4 ray_inverse; // in the picture's axes; the point is ray / inverse

uniform vec4 view_from_picture[3]; // rows, metres
uniform vec4 view_lens;            // fx, fy, cx, cy
uniform vec4 view_range;           // width, height, nearest z drawn
uniform vec4 order; // of this picture; 1: it is judged; share that a later one is put back by; its layer
// Least and most inverse distance about each 2 x 2 pixels; least < 0: none of the four is measured; most < 0: not known.
uniform sampler2DArray ranges;

out float inverse;
out float through; // share that looks through the surface here
out vec3 own_ray;  // in the picture's axes, for surround_surface_unasked.frag

#include "surround_picture.glsl"

// Share of the pictures, weighted by 1 / sine of the angle to the view, that see something behind the point p / inverse;
// those from which it is hidden say nothing. Tolerances as in view_merge.c.
void judge(int i, vec3 p, float per_near, inout float sum, inout float weights)
{
    vec3 turned, q = in_picture(i, p, ray_inverse.w, turned);
    ivec2 at = clamp(ivec2(pixel_of(q) + 0.5), ivec2(0), ivec2(camera[0].zw) - 1) / 2;
    vec2 range = texelFetch(ranges, ivec3(at, layer_of(i)), 0).rg;
    float per_far = inversesqrt(dot(q, q) + 1e-18), wanted = ray_inverse.w * per_far;
    float cosine = dot(turned, q) * per_far * per_near;
    float weight = 1.0 / (sqrt(max(1.0 - cosine * cosine, 0.0)) + 0.05);
    bool silent = !in_frame(i, q) || range.y < 0.0 || abs(range.x) > wanted * 1.03 + 1e-4;
    weights += silent ? 0.0 : weight;
    sum += silent || range.y >= wanted * 0.97 - 1e-4 ? 0.0 : weight;
}
#define FOR_EACH(i) judge(i, p, per_near, sum, weights);

float share_through(vec3 p)
{
    float sum = 0.0, weights = 0.0, per_near = inversesqrt(dot(p, p) + 1e-18);
    FOR_EACH_PICTURE
    return weights > 0.0 ? sum / weights : 0.0;
}

void main()
{
    vec4 a = view_from_picture[0], b = view_from_picture[1], c = view_from_picture[2];
    vec3 ray = ray_inverse.xyz;
    inverse = ray_inverse.w;
    own_ray = ray;
    vec3 p = vec3(dot(a.xyz, ray), dot(b.xyz, ray), dot(c.xyz, ray)) + inverse * vec3(a.w, b.w, c.w);
    vec2 px = view_lens.xy * p.xy + (view_lens.zw + 0.5) * p.z;
    through = order.y > 0.0 ? share_through(p) : 0.0;
    // The nearer half of the depth range is for what passes the test. 1 / z is linear in the image, and so is this. The
    // earlier picture wins where two nearly agree, so that a surface is of one picture, not of their noise.
    float shown = inverse * (1.0 - order.z * (1.0 - 1.0 / (1.0 + order.x))) * view_range.z;
    // 0.4 where view_merge.c has 0.5, which draws a little worse here: share_through asks whole pixels, not their shares.
    float half_from = through > 0.4 ? 0.9999 : -0.0001;
    gl_Position = vec4(2.0 * px / view_range.xy - p.z, half_from * p.z - 0.9999 * shown, p.z);
}
