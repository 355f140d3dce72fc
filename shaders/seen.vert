#version 300 es
// Vertex of a point that is asked for: a pixel of the answers' image, with where the point is in the picture.
precision highp float;

layout(location = 0) in vec4 at;    // x, y: corner of its pixel, in clip space of the answers' image
layout(location = 1) in vec4 point; // x, y in pixels of the picture; depth in clip space

out vec3 asked;

void main()
{
    asked = point.xyz;
    gl_Position = vec4(at.xy, 0.0, 1.0);
}
