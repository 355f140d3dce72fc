#include "tests/world/glyphs.h"

#include "tests/world/numbers.h"

#include <math.h>
#include <string.h>

// Each stroke is a run of points "xy" with x in 0..4 and y in 0..6; ',' lifts the pen.
static const char *const digits[10] = {
    "103041453616050110",
    "152620,1030",
    "05163645440040",
    "0516364544332333,334241301001",
    "30360242",
    "460603334241301001",
    "453616050110304142331302",
    "064620",
    "13040516364544331302011030414233",
    "011030414536160504133344",
};
static const char *const letters[26] = {
    "0004264440,0242",
    "00063645443303,3342413000",
    "4536160501103041",
    "00062644422000",
    "46060040,0333",
    "460600,0333",
    "45361605011030414323",
    "0600,4640,0343",
    "2620,1636,1030",
    "4641301001",
    "0600,460340",
    "060040",
    "0006234640",
    "00064046",
    "103041453616050110",
    "00063645443303",
    "103041453616050110,2240",
    "00063645443303,2340",
    "453616050413334241301001",
    "0646,2620",
    "060110304146",
    "062046",
    "0610233046",
    "0046,0640",
    "062346,2320",
    "06460040",
};

static float segment(float x, float y, float ax, float ay, float bx, float by)
{
    float dx = bx - ax, dy = by - ay, l = dx * dx + dy * dy;
    float t = l > 0 ? ((x - ax) * dx + (y - ay) * dy) / l : 0;
    t = minf(1, maxf(0, t));
    float ex = x - ax - t * dx, ey = y - ay - t * dy;
    return sqrtf(ex * ex + ey * ey);
}

float glyph_distance(char letter, float x, float y)
{
    const char *s = letter >= '0' && letter <= '9'   ? digits[letter - '0']
                    : letter >= 'A' && letter <= 'Z' ? letters[letter - 'A']
                                                     : "";
    float nearest = 100;
    bool down = false;
    float px = 0, py = 0;
    while (*s) {
        if (*s == ' ' || *s == ',') {
            down = down && *s == ' ';
            s++;
            continue;
        }
        float qx = (float)(s[0] - '0'), qy = (float)(s[1] - '0');
        if (down)
            nearest = minf(nearest, segment(x, y, px, py, qx, qy));
        px = qx, py = qy;
        down = true;
        s += 2;
    }
    return nearest;
}

float text_distance(const char *text, float x, float y)
{
    if (y < -2 || y > 8)
        return 100;
    int i = (int)floorf((x + 0.6f) / 5.2f), n = (int)strlen(text);
    if (i < 0 || i >= n)
        return 100;
    return glyph_distance(text[i], x - 5.2f * (float)i, y);
}

float text_width(const char *text) { return 5.2f * (float)strlen(text) - 1.2f; }
