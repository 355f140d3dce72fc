#version 300 es
// Fragment of a body cylinder: its colour is what the selected source frame shows at this point.
precision highp float;

in vec3 source_point;

uniform vec4 source_lens[3]; // as view_lens in actor.vert
uniform vec4 source_window;  // part of that frame in the texture: left, top, width, height, pixels
uniform vec4 code;           // w: 1 to write xyz instead of colours
uniform highp sampler2D source_image;

out vec4 color; // premultiplied

#include "lens.glsl"

void main()
{
    if (source_point.z < 1e-3)
        discard; // behind the source camera
    vec2 q = source_point.xy / source_point.z;
    float r2 = min(dot(q, q), source_lens[2].y);
    vec2 px = source_lens[0].xy * distort_point(q, r2, source_lens[1], source_lens[2].x) + source_lens[0].zw;
    vec4 seen = texture(source_image, (px - source_window.xy + 0.5) / source_window.zw);
    color = vec4(code.w > 0.5 ? code.xyz : seen.rgb, 1.0);
}
