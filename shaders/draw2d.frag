#version 300 es
// What controls are made of: a texture, tinted.
precision highp float;
in vec2 at;
in vec4 tint; // premultiplied
uniform highp sampler2D picture; // premultiplied
out vec4 color;
void main()
{
    color = texture(picture, at) * tint;
}
