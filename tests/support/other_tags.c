#include "tests/support/other_tags.h"

#include "platform/vision/tag_detector.h"

#include <apriltag/apriltag.h>
#include <apriltag/tag16h5.h>
#include <apriltag/tag25h9.h>
#include <apriltag/tag36h10.h>
#include <apriltag/tagCircle21h7.h>
#include <apriltag/tagCircle49h12.h>
#include <apriltag/tagCustom48h12.h>
#include <apriltag/tagStandard41h12.h>
#include <apriltag/tagStandard52h13.h>
#include <stdlib.h>

// By the numbers of platform/vision/tag_detector.h.
static apriltag_family_t *create(int family)
{
    switch (family) {
    case 0: return tag16h5_create();
    case 1: return tag25h9_create();
    case 2: return tag36h10_create();
    case 3: return tagCircle21h7_create();
    case 4: return tagCircle49h12_create();
    case 5: return tagCustom48h12_create();
    case 6: return tagStandard41h12_create();
    default: return tagStandard52h13_create();
    }
}

void other_tag_draw(int family, int id, uint8_t *gray, int width, int height, int x, int y, int cell)
{
    static apriltag_family_t *made[TAG_FAMILIES]; // kept: how one is freed differs from family to family
    apriltag_family_t *const f = made[family] ? made[family] : (made[family] = create(family));
    image_u8_t *tag = f ? apriltag_to_image(f, id) : NULL;
    if (!tag || x < 0 || y < 0 || x + tag->width * cell > width || y + tag->height * cell > height)
        abort();
    for (int v = 0; v < tag->height * cell; v++)
        for (int u = 0; u < tag->width * cell; u++)
            gray[(y + v) * width + x + u] = tag->buf[v / cell * tag->stride + u / cell];
    free(tag->buf); // as image_u8_destroy does, which the library keeps to itself
    free(tag);
}
