#version 300 es
// As surround_surface.frag, of a picture that is not among those asked (pictures[]): what nothing supports is left out,
// as by is_unsupported in view_merge.c. Decided for each pixel: such surfaces end at what hides them from the others,
// not at a vertex.
precision highp float;
precision highp int;
precision highp sampler2DArray;

in float inverse;
in float through;
in vec3 own_ray; // in the picture's axes

uniform vec4 view_lens;  // fx, fy, cx, cy
uniform vec4 view_range; // width, height, nearest z drawn
uniform vec4 order;      // of this picture; w: its layer
uniform sampler2DArray ranges; // least and most inverse distance about each 2 x 2 pixels; least < 0: none is measured
uniform sampler2DArray depths; // inverse distances; negative: not known

out vec4 kept;

#include "surround_depth.glsl"
#include "surround_picture.glsl"

const float MOST_THROUGH = 0.75; // as in surround_surface.frag

ivec2 pixel_at(vec3 q) { return clamp(ivec2(pixel_of(q) + 0.5), ivec2(0), ivec2(camera[0].zw) - 1); }

// Whether a picture sees the point along / inverse_z or looks through it.
bool observes(int i, vec3 along, float inverse_z)
{
    vec3 turned, q = in_picture(i, along, inverse_z, turned);
    float wanted = inverse_z * inversesqrt(dot(q, q) + 1e-18);
    float there = texelFetch(depths, ivec3(pixel_at(q), layer_of(i)), 0).r;
    return in_frame(i, q) && there >= 0.0 && there <= wanted * 1.03 + 1e-4;
}
#define FOR_EACH(i) supported = supported || observes(i, along, inverse_z);

void main()
{
    float inverse_z = inverse * gl_FragCoord.w;
    vec3 along = vec3((gl_FragCoord.xy - 0.5 - view_lens.zw) / view_lens.xy, 1.0);
    bool supported = texelFetch(ranges, ivec3(pixel_at(own_ray) / 2, int(order.w)), 0).r >= 0.0;
    FOR_EACH_PICTURE
    if (through > MOST_THROUGH || !supported)
        discard;
    kept = pack_surface(inverse_z, view_range.z, order.x);
}
