uniform highp sampler2DShadow actor; // depth of the actor's image, and of the room where that is not in `room`

#include "room_visibility.glsl"

// Share of the pixel about `at_px` in which nothing of the picture, neither actor nor room, is before depth z.
float picture_visibility(vec2 at_px, float z)
{
    return texture(actor, vec3(at_px / vec2(textureSize(actor, 0)), z)) * room_visibility_at(at_px, z);
}
