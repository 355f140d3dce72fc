#version 300 es
// Vertex of 2D drawing (controls): pixels to clip space.
precision highp float;
layout(location = 0) in vec2 position; // pixels
layout(location = 1) in vec2 uv;
layout(location = 2) in vec4 color; // straight alpha
uniform vec4 map[2]; // rows of the affine map from pixels to clip space; w: used share of the texture, along that axis
out vec2 at;
out vec4 tint; // premultiplied
void main()
{
    vec3 p = vec3(position, 1.0);
    gl_Position = vec4(dot(map[0].xyz, p), dot(map[1].xyz, p), 0.0, 1.0);
    at = uv * vec2(map[0].w, map[1].w);
    tint = vec4(color.rgb * color.a, color.a);
}
