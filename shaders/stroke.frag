#version 300 es
// Fragment of a stroke: a line with round ends, smooth at its edge, hidden by what the picture shows before it.
precision highp float;

in vec4 place;
in float radius;
in vec4 shade;

out vec4 color; // premultiplied

#include "picture_visibility.glsl"

void main()
{
    float beyond = place.x - clamp(place.x, 0.0, place.z);
    float share = clamp(radius + 0.5 - length(vec2(beyond, place.y)), 0.0, 1.0);
    if (place.w > 0.0 && mod(place.x, 2.0 * place.w) > place.w)
        share = 0.0; // between two dashes
    share *= shade.a * picture_visibility(gl_FragCoord.xy, gl_FragCoord.z);
    color = vec4(shade.rgb * share, share);
}
