#version 300 es
// Vertex of a coloured, textured surface: from its axes to the viewer's image, lens distortion included.
precision highp float;

layout(location = 0) in vec4 at_u;     // metres, and the texture's u
layout(location = 1) in vec4 normal_v; // unit length or 0: not lit; and the texture's v
layout(location = 2) in vec4 tone;     // colour, straight alpha

uniform vec4 viewer_from_solid[3]; // rows of the affine map into the viewer camera's axes, metres
uniform vec4 view_lens[3];         // (fx, fy, cx, cy), (k1, k2, p1, p2), (k3, largest r2, width, height)
uniform vec4 view_range;           // nearest and farthest z drawn, metres

out vec2 uv;
out vec4 shade;

#include "lens.glsl"

void main()
{
    vec4 h = vec4(at_u.xyz, 1.0), n4 = vec4(normal_v.xyz, 0.0);
    vec3 p = vec3(dot(viewer_from_solid[0], h), dot(viewer_from_solid[1], h), dot(viewer_from_solid[2], h));
    vec3 n = vec3(dot(viewer_from_solid[0], n4), dot(viewer_from_solid[1], n4), dot(viewer_from_solid[2], n4));
    uv = vec2(at_u.w, normal_v.w);
    // A lamp at the viewer's left shoulder; enough light from everywhere else that nothing is black.
    float length_n = length(n);
    float light = length_n > 0.0 ? 0.55 + 0.45 * abs(dot(n / length_n, normalize(vec3(-0.4, -0.6, -0.7)))) : 1.0;
    shade = vec4(tone.rgb * light, tone.a);
    vec2 d = distort_vertex(p, view_lens[1], view_lens[2].x, view_lens[2].y);
    vec2 px = view_lens[0].xy * d + (view_lens[0].zw + 0.5) * p.z;
    float near = view_range.x, far = view_range.y;
    gl_Position = vec4(2.0 * px / view_lens[2].zw - p.z, ((far + near) * p.z - 2.0 * far * near) / (far - near), p.z);
}
