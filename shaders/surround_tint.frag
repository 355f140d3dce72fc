#version 300 es
// A box, transparent, in front of what stands behind it: where the pixel's ray meets it before the surface.
precision highp float;
precision highp int;

uniform highp sampler2D surface;
uniform vec4 view_lens;       // fx, fy, cx, cy
uniform vec4 box_from_view[3]; // rows, metres
uniform vec4 box[2];          // lowest corner, nearest z drawn; highest corner
uniform vec4 tint;            // premultiplied

out vec4 color;

#include "surround_depth.glsl"

void main()
{
    ivec2 at = ivec2(gl_FragCoord.xy);
    vec4 kept = texelFetch(surface, at, 0);
    float nearest = box[0].w, surface_z = kept.a > 0.0 ? 1.0 / max(unpack_inverse_z(kept, nearest), 1e-6) : 1e9;
    vec3 along = vec3((vec2(at) - view_lens.zw) / view_lens.xy, 1.0);
    vec3 ray = vec3(dot(box_from_view[0].xyz, along), dot(box_from_view[1].xyz, along), dot(box_from_view[2].xyz, along));
    vec3 from = vec3(box_from_view[0].w, box_from_view[1].w, box_from_view[2].w);
    ray += vec3(equal(ray, vec3(0.0))) * 1e-9;
    vec3 a = (box[0].xyz - from) / ray, b = (box[1].xyz - from) / ray, low = min(a, b), high = max(a, b);
    float enter = max(low.x, max(low.y, low.z)), leave = min(high.x, min(high.y, high.z)); // z along the view
    color = enter > nearest && enter < leave && enter <= surface_z ? tint : vec4(0.0);
}
