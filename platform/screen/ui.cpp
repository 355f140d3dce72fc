// ui.h by Dear ImGui: its draw lists, font atlas and hit testing. gpu_draw2d draws; none of ImGui's own widgets is
// used.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wpedantic"
extern "C" {
#include "platform/screen/gpu.h"
}
#include "platform/screen/system_fonts.h"
#include "platform/screen/ui.h"
#pragma GCC diagnostic pop

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <imgui.h>
#include <imgui_internal.h>
#include <new>
#include <set>
#include <vector>

static_assert(sizeof(gpu_draw2d_vertex) == sizeof(ImDrawVert), "vertices are copied one for one");
static_assert(sizeof(ImDrawIdx) == sizeof(uint16_t), "indices are copied as they are");

using letter_set = std::set<uint32_t>; // Unicode; beyond those that every atlas has

struct ui {
    struct gpu *gpu;
    ImGuiContext *context;
    gpu_draw2d *draw2d;
    gpu_texture *font_texture;
    std::vector<ui_face> faces;
    std::vector<ImFont *> fonts;
    double px_per_dp;
    // Of each face the letters that texts asked for, and those of them that the atlas was built with.
    std::vector<letter_set> asked, built;
    bool letters_wanted, letters_refused; // texts asked for more; with them the atlas would be too large for the GPU
    struct system_fonts *system; // NULL until a text asks for a letter that the faces lack, or if there are none
    int width_px, height_px;
    int layer;
    int64_t now_ns, rest_ns;       // rest_ns: since when the pointer is on the area of rest_id
    ImGuiID rest_id, seen_rest;    // 0: on none; seen_rest: found in this frame
    bool long_held, was_long_held; // an area was held until it rested, in this frame and in the last
    std::vector<ui_mark> marks;
    ImDrawList *draw_list; // between ui_begin and ui_end
    std::vector<gpu_draw2d_batch> batches;
    std::vector<gpu_draw2d_vertex> vertices;
    std::vector<uint16_t> indices;
};

namespace
{

ImU32 to_imgui_color(uint32_t color) { return IM_COL32(color >> 24, color >> 16 & 255, color >> 8 & 255, color & 255); }

ImVec2 at(double x, double y) { return ImVec2(float(x), float(y)); }
ImVec2 at(ui_point p) { return at(p.x, p.y); }
ImVec2 first(ui_box b) { return at(b.x, b.y); }
ImVec2 last(ui_box b) { return at(b.x + b.w, b.y + b.h); }

// Latin with accents, typographic punctuation, arrows and the minus sign.
const ImWchar glyph_ranges[] = {0x20,   0x7e,   0xa0,   0x24f,  0x2010, 0x2027, 0x2030, 0x203a,
                                0x20ac, 0x20ac, 0x2190, 0x2193, 0x2212, 0x2212, 0};
const ImWchar digits[] = {'0', '9', 0};
const ImWchar ascii[] = {0x20, 0x7e, 0xb0, 0xb0, 0};
// What else the faces have: Greek, Cyrillic and Vietnamese. It takes as much of the atlas again, so only where a name
// holds any of it, but then all, because other letters of the same name will follow.
const ImWchar own_ranges[] = {0x300, 0x52f, 0x1e00, 0x1fff, 0};
// Scripts whose letters are joined, reordered or run from right to left, which ImGui cannot do; controls; surrogates
// and private letters.
const ImWchar unshaped_ranges[] = {0x1,    0x1f,   0x7f,   0x9f,   0x590,  0xdff,  0xf00,  0x109f,
                                   0x1780, 0x18af, 0x1900, 0x1cff, 0x200b, 0x200f, 0x202a, 0x202e,
                                   0x2060, 0x206f, 0xa800, 0xabff, 0xd800, 0xf8ff, 0xfb1d, 0xfdff,
                                   0xfe00, 0xfe0f, 0xfe70, 0xfeff, 0xfff0, 0xffff, 0};

bool is_in(const ImWchar *ranges, uint32_t letter)
{
    for (; *ranges; ranges += 2)
        if (letter >= ranges[0] && letter <= ranges[1])
            return true;
    return false;
}

// The computer's fonts for those of the letters that the faces lack; the caller frees their bytes.
int read_system_fonts(ui *u, const std::vector<letter_set> &letters, system_font out[SYSTEM_FONTS_MAX])
{
    letter_set foreign;
    for (const letter_set &of_face : letters)
        for (uint32_t letter : of_face)
            if (!is_in(own_ranges, letter))
                foreign.insert(letter);
    if (!foreign.empty() && !u->system)
        u->system = system_fonts_open();
    if (foreign.empty() || !u->system)
        return 0;
    const std::vector<uint32_t> list(foreign.begin(), foreign.end());
    return system_fonts_read(u->system, list.data(), int(list.size()), out);
}

const float EM_OF_LINE = 0.83F; // of the faces: Inter's

// Adds the face to the atlas, and behind it the fonts for what it lacks. `ranges` must last until the atlas is built.
ImFont *add_face(const ui_face &face, float size, const ImWchar *ranges, const system_font *others, int other_count)
{
    ImFontAtlas *atlas = ImGui::GetIO().Fonts;
    ImFontConfig how;
    how.FontDataOwnedByAtlas = false;
    how.OversampleH = 2;
    how.OversampleV = 1;
    how.GlyphRanges = ranges;
    ImFont *font = atlas->AddFontFromMemoryTTF(const_cast<uint8_t *>(face.bytes), int(face.count), size, &how);
    for (int i = 0; font && i < other_count; i++) {
        how.MergeMode = true;
        how.FontNo = others[i].index;
        atlas->AddFontFromMemoryTTF(others[i].bytes, int(others[i].count), size, &how);
        // Lines of other fonts are up to half as high again for letters of the same size: negative, the size of an em.
        atlas->ConfigData.back().SizePixels = -EM_OF_LINE * size;
    }
    return font;
}

// All faces, with those letters.
bool build_atlas(ui *u, double px_per_dp, const std::vector<letter_set> &letters, const system_font *others,
                 int other_count)
{
    ImFontAtlas *atlas = ImGui::GetIO().Fonts;
    std::vector<ImVector<ImWchar>> ranges(u->faces.size());
    atlas->Clear();
    u->fonts.clear();
    for (size_t f = 0; f < u->faces.size(); f++) {
        const ui_face &face = u->faces[f];
        ImFontGlyphRangesBuilder builder;
        builder.AddRanges(face.digits_only ? digits : face.ascii_only ? ascii : glyph_ranges);
        for (uint32_t letter : letters[f])
            if (is_in(own_ranges, letter))
                builder.AddRanges(own_ranges);
            else
                builder.AddChar(ImWchar(letter));
        builder.BuildRanges(&ranges[f]);
        const bool merged = !letters[f].empty();
        ImFont *font =
            add_face(face, float(std::lround(face.size * px_per_dp)), ranges[f].Data, others, merged ? other_count : 0);
        if (!font)
            return false;
        u->fonts.push_back(font);
    }
    return atlas->Build();
}

enum status build_font_atlas(ui *u, double px_per_dp, const std::vector<letter_set> &letters)
{
    ImFontAtlas *atlas = ImGui::GetIO().Fonts;
    system_font others[SYSTEM_FONTS_MAX];
    const int other_count = read_system_fonts(u, letters, others);
    // A font that fontconfig reads and ImGui does not costs its letters alone.
    const bool is_built = build_atlas(u, px_per_dp, letters, others, other_count) ||
                          (other_count && build_atlas(u, px_per_dp, letters, nullptr, 0));
    for (int i = 0; i < other_count; i++)
        free(others[i].bytes);
    if (!is_built)
        return fail(ERR_INPUT, "a font of the controls cannot be read");
    unsigned char *pixels = nullptr;
    int width = 0, height = 0;
    atlas->GetTexDataAsRGBA32(&pixels, &width, &height);
    for (long i = 0, n = long(width) * height; i < n; i++) // premultiplied white
        pixels[4 * i] = pixels[4 * i + 1] = pixels[4 * i + 2] = pixels[4 * i + 3];
    gpu_texture_close(&u->font_texture);
    const gpu_texture_layout layout = {GPU_RGBA8, width, height, GPU_LINEAR};
    enum status status = gpu_texture_open(&u->font_texture, u->gpu, &layout, pixels);
    atlas->SetTexID(u->font_texture);
    atlas->ClearTexData();
    atlas->ClearInputData(); // points to bytes that are freed
    u->px_per_dp = px_per_dp;
    u->built = letters;
    return status;
}

enum status open_ui(ui *u, const gpu_draw2d_shaders *shaders)
{
    enum status status = gpu_draw2d_open(&u->draw2d, u->gpu, shaders);
    if (status != OK)
        return status;
    u->context = ImGui::CreateContext();
    ImGui::SetCurrentContext(u->context);
    ImGuiIO &io = ImGui::GetIO();
    io.IniFilename = nullptr; // ImGui writes no files
    io.LogFilename = nullptr;
    io.BackendFlags |= ImGuiBackendFlags_RendererHasVtxOffset;
    io.MouseDragThreshold = 0;
    io.ConfigMemoryCompactTimer = -1;
    ImGuiStyle &style = ImGui::GetStyle();
    style.WindowPadding = style.ItemSpacing = ImVec2(0, 0);
    style.WindowBorderSize = 0;
    style.CurveTessellationTol = 0.4F;
    style.CircleTessellationMaxError = 0.15F;
    return OK;
}

// With the letters that were asked for; where the GPU does not take that many, with those of before, or none.
enum status build_widest_font_atlas(ui *u, double px_per_dp)
{
    const std::vector<letter_set> none(u->faces.size()), before = u->built;
    u->letters_wanted = u->letters_refused = false;
    enum status status = build_font_atlas(u, px_per_dp, u->asked);
    if (status == ERR_DEVICE && u->asked != before) {
        u->letters_refused = true;
        status = build_font_atlas(u, px_per_dp, before);
    }
    if (status == ERR_DEVICE && before != none) {
        u->letters_refused = true;
        status = build_font_atlas(u, px_per_dp, none);
    }
    return status;
}

// Whether the atlas has all that the face has beyond Latin.
bool has_own_ranges(const ui *u, int face)
{
    for (uint32_t letter : u->built[size_t(face)])
        if (is_in(own_ranges, letter))
            return true;
    return false;
}

// Notes the letters of a text that the atlas lacks.
void ask_for_letters(ui *u, int face, const char *text)
{
    if (u->faces[size_t(face)].digits_only || u->faces[size_t(face)].ascii_only)
        return;
    while (*text) {
        unsigned letter = uint8_t(*text);
        text += letter < 0x80 ? 1 : ImTextCharFromUtf8(&letter, text, nullptr);
        if (letter > 0x24f && letter <= IM_UNICODE_CODEPOINT_MAX && !is_in(glyph_ranges, letter) &&
            !is_in(unshaped_ranges, letter) && u->asked[size_t(face)].insert(letter).second)
            u->letters_wanted = u->letters_wanted || !is_in(own_ranges, letter) || !has_own_ranges(u, face);
    }
}

ImFont *font_of(const ui *u, int face)
{
    IM_ASSERT(face >= 0 && size_t(face) < u->fonts.size());
    return u->fonts[size_t(face)];
}

float size_of(const ui *u, int face) { return float(u->faces[size_t(face)].size); }

const int64_t REST_NS = 500000000; // chosen by hand: longer than a tap, shorter than patience

void mark(ui *u, bool is_text, const char *text, struct ui_box box)
{
    if (!*text)
        return;
    const ImVec2 low = u->draw_list->GetClipRectMin(), high = u->draw_list->GetClipRectMax();
    const size_t length = strlen(text);
    const bool shortened = is_text && length > 3 && !strcmp(text + length - 3, "…");
    ui_mark m = {is_text, shortened, {}, box, {low.x, low.y, double(high.x) - low.x, double(high.y) - low.y}, u->layer};
    for (size_t i = 0; i + 1 < sizeof m.text && text[i]; i++)
        m.text[i] = text[i];
    u->marks.push_back(m);
}

// Notes on which area the pointer stays.
void note_rest(ui *u, ui_touch *touch)
{
    const ImGuiID id = ImGui::GetItemID();
    touch->rested = u->was_long_held && id == u->rest_id;
    if (!touch->over && !touch->held)
        return;
    u->rest_ns = id == u->rest_id ? u->rest_ns : u->now_ns;
    u->rest_id = u->seen_rest = id;
    touch->rests = u->now_ns - u->rest_ns >= REST_NS;
    u->long_held = u->long_held || (touch->rests && touch->held);
}

} // namespace

extern "C" {

enum status ui_open(struct ui **out, struct gpu *gpu, const struct gpu_draw2d_shaders *shaders,
                    const struct ui_face *faces, int face_count)
{
    *out = nullptr;
    ui *u = new (std::nothrow) ui{};
    if (!u)
        return fail(ERR_MEMORY, "out of memory");
    u->gpu = gpu;
    u->faces.assign(faces, faces + face_count);
    u->asked.resize(u->faces.size());
    u->built.resize(u->faces.size());
    enum status status = open_ui(u, shaders);
    if (status != OK)
        ui_close(&u);
    *out = u;
    return status;
}

void ui_close(struct ui **out)
{
    ui *u = *out;
    if (!u)
        return;
    if (u->context) {
        ImGui::SetCurrentContext(u->context);
        ImGui::GetIO().Fonts->SetTexID(nullptr);
        ImGui::DestroyContext(u->context);
    }
    gpu_texture_close(&u->font_texture);
    gpu_draw2d_close(&u->draw2d);
    system_fonts_close(&u->system);
    delete u;
    *out = nullptr;
}

enum status ui_begin(struct ui *u, const struct ui_input *in)
{
    ImGui::SetCurrentContext(u->context);
    if (in->px_per_dp != u->px_per_dp || ui_letters_wanted(u)) {
        enum status status = build_widest_font_atlas(u, in->px_per_dp);
        if (status != OK)
            return status;
    }
    u->width_px = in->width_px;
    u->height_px = in->height_px;
    u->now_ns = in->now_ns;
    u->was_long_held = u->long_held;
    u->long_held = false;
    u->seen_rest = 0;
    u->layer = 0;
    u->marks.clear();
    ImGuiIO &io = ImGui::GetIO();
    // Rounded up: ImGui clips to whole dp, and rounding down would leave the last row and column empty.
    io.DisplaySize =
        ImVec2(float(std::ceil(in->width_px / in->px_per_dp)), float(std::ceil(in->height_px / in->px_per_dp)));
    io.DisplayFramebufferScale = ImVec2(float(in->px_per_dp), float(in->px_per_dp));
    io.DeltaTime = 1.0F / 60; // any value: ImGui's own animations are not used
    io.MousePos = in->pointer_there ? ImVec2(float(in->pointer_x), float(in->pointer_y)) : ImVec2(-FLT_MAX, -FLT_MAX);
    io.MouseDown[0] = in->pointer_down;
    ImGui::NewFrame();
    ImGui::SetNextWindowPos(ImVec2(0, 0));
    ImGui::SetNextWindowSize(io.DisplaySize);
    ImGui::Begin("screen", nullptr,
                 ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoBackground | ImGuiWindowFlags_NoMove |
                     ImGuiWindowFlags_NoSavedSettings | ImGuiWindowFlags_NoNav |
                     ImGuiWindowFlags_NoBringToFrontOnFocus);
    u->draw_list = ImGui::GetWindowDrawList();
    u->draw_list->_FringeScale = float(1 / in->px_per_dp); // anti-aliasing over one pixel, not one dp
    u->draw_list->ChannelsSplit(UI_LAYERS);
    return OK;
}

void ui_end(struct ui *u)
{
    u->draw_list->ChannelsMerge();
    ImGui::End();
    ImGui::Render();
    const ImDrawData *data = ImGui::GetDrawData();
    u->batches.clear();
    u->vertices.clear();
    u->indices.clear();
    const float s = float(u->px_per_dp);
    for (int n = 0; n < data->CmdListsCount; n++) {
        const ImDrawList *list = data->CmdLists[n];
        const int base_vertex = int(u->vertices.size()), base_index = int(u->indices.size());
        for (const ImDrawVert &v : list->VtxBuffer) {
            gpu_draw2d_vertex out = {v.pos.x * s, v.pos.y * s, v.uv.x, v.uv.y, {}};
            for (int c = 0; c < 4; c++)
                out.rgba[c] = uint8_t(v.col >> (8 * c));
            u->vertices.push_back(out);
        }
        u->indices.insert(u->indices.end(), list->IdxBuffer.begin(), list->IdxBuffer.end());
        for (const ImDrawCmd &c : list->CmdBuffer)
            if (c.ElemCount)
                u->batches.push_back({static_cast<const gpu_texture *>(c.TextureId), std::fmax(0.0F, c.ClipRect.x * s),
                                      std::fmax(0.0F, c.ClipRect.y * s),
                                      std::fmin(float(u->width_px), c.ClipRect.z * s),
                                      std::fmin(float(u->height_px), c.ClipRect.w * s), base_vertex + int(c.VtxOffset),
                                      base_index + int(c.IdxOffset), int(c.ElemCount)});
    }
    u->draw_list = nullptr;
    u->rest_id = u->seen_rest;
}

enum status ui_draw(struct ui *u, struct gpu_target *target, int quarter_turns)
{
    static const float black[3] = {0, 0, 0};
    const gpu_draw2d_view view = {target, u->width_px, u->height_px, quarter_turns, black};
    gpu_draw2d_begin(u->draw2d, &view);
    const gpu_draw2d_list list = {u->vertices.data(),      u->indices.data(),      u->batches.data(),
                                  int(u->vertices.size()), int(u->indices.size()), int(u->batches.size())};
    gpu_draw2d_draw(u->draw2d, &list);
    return gpu_draw2d_end(u->draw2d);
}

bool ui_letters_wanted(const struct ui *u) { return u->letters_wanted && !u->letters_refused; }

double ui_width(const struct ui *u) { return u->width_px / u->px_per_dp; }
double ui_height(const struct ui *u) { return u->height_px / u->px_per_dp; }
double ui_px_per_dp(const struct ui *u) { return u->px_per_dp; }

// ---------------------------------------------------------------- drawing

int ui_layer(struct ui *u, int layer)
{
    const int before = u->layer;
    u->draw_list->ChannelsSetCurrent(layer);
    u->layer = layer;
    return before;
}

void ui_fill(struct ui *u, struct ui_box box, double radius, uint32_t color)
{
    u->draw_list->AddRectFilled(first(box), last(box), to_imgui_color(color), float(radius));
}

void ui_border(struct ui *u, struct ui_box box, double radius, double thickness, uint32_t color)
{
    u->draw_list->AddRect(first(box), last(box), to_imgui_color(color), float(radius), 0, float(thickness));
}

void ui_fade(struct ui *u, struct ui_box box, uint32_t top, uint32_t bottom)
{
    u->draw_list->AddRectFilledMultiColor(first(box), last(box), to_imgui_color(top), to_imgui_color(top),
                                          to_imgui_color(bottom), to_imgui_color(bottom));
}

void ui_shadow(struct ui *u, struct ui_box box, double radius, double spread, uint32_t color)
{
    // Growing, fading boxes over one another: approximates a blur cheaply.
    const int rings = 8;
    for (int i = rings; i > 0; i--) {
        double grow = spread * i / rings;
        uint32_t alpha = uint32_t((color & 255) * (1.0 - double(i) / (rings + 1)) / rings * 1.6);
        ui_box grown = {box.x - grow, box.y - grow + spread / 4, box.w + 2 * grow, box.h + 2 * grow};
        ui_fill(u, grown, radius + grow, (color & ~255U) | alpha);
    }
}

void ui_disc(struct ui *u, struct ui_point centre, double radius, uint32_t color)
{
    u->draw_list->AddCircleFilled(at(centre), float(radius), to_imgui_color(color));
}

void ui_ring(struct ui *u, struct ui_point centre, double radius, double thickness, uint32_t color)
{
    u->draw_list->AddCircle(at(centre), float(radius), to_imgui_color(color), 0, float(thickness));
}

void ui_line(struct ui *u, struct ui_point a, struct ui_point b, double thickness, uint32_t color)
{
    u->draw_list->AddLine(at(a), at(b), to_imgui_color(color), float(thickness));
}

void ui_stroke(struct ui *u, const struct ui_point *points, int count, bool closed, double thickness, uint32_t color)
{
    for (int i = 0; i < count; i++)
        u->draw_list->PathLineTo(at(points[i]));
    u->draw_list->PathStroke(to_imgui_color(color), closed ? ImDrawFlags_Closed : 0, float(thickness));
    if ((color & 255) == 255) // a translucent joint would be blended twice
        for (int i = 0; i < count; i++)
            u->draw_list->AddCircleFilled(at(points[i]), float(thickness / 2), to_imgui_color(color));
}

void ui_polygon(struct ui *u, const struct ui_point *points, int count, uint32_t color)
{
    for (int i = 0; i < count; i++)
        u->draw_list->PathLineTo(at(points[i]));
    u->draw_list->PathFillConvex(to_imgui_color(color));
}

void ui_image(struct ui *u, const struct gpu_texture *texture, struct ui_box box, struct ui_uv_rect part, double radius,
              uint32_t tint)
{
    ImTextureID id = const_cast<gpu_texture *>(texture);
    u->draw_list->AddImageRounded(id, first(box), last(box), at(part.u0, part.v0), at(part.u1, part.v1),
                                  to_imgui_color(tint), float(radius));
}

// ---------------------------------------------------------------- text

double ui_text_width(struct ui *u, int face, const char *text)
{
    ask_for_letters(u, face, text);
    return double(font_of(u, face)->CalcTextSizeA(size_of(u, face), FLT_MAX, 0, text).x);
}

double ui_text_height(struct ui *u, int face, const char *text, double width)
{
    ask_for_letters(u, face, text);
    return double(font_of(u, face)->CalcTextSizeA(size_of(u, face), FLT_MAX, float(width), text).y);
}

void ui_text(struct ui *u, int face, struct ui_point top_left, uint32_t color, const char *text)
{
    ui_text_lines(u, face, top_left, 0, color, text);
}

void ui_text_lines(struct ui *u, int face, struct ui_point top_left, double width, uint32_t color, const char *text)
{
    const ImVec2 size = font_of(u, face)->CalcTextSizeA(size_of(u, face), FLT_MAX, float(width), text);
    ask_for_letters(u, face, text);
    mark(u, true, text, {top_left.x, top_left.y, double(size.x), double(size.y)});
    // Rounded to whole pixels: text between them is blurred.
    const double s = u->px_per_dp;
    ImVec2 where = at(std::round(top_left.x * s) / s, std::round(top_left.y * s) / s);
    u->draw_list->AddText(font_of(u, face), size_of(u, face), where, to_imgui_color(color), text, nullptr,
                          float(width));
}

struct ui_point ui_text_extent(struct ui *u, int face, double size, const char *text, double width)
{
    const ImVec2 extent = font_of(u, face)->CalcTextSizeA(float(size), FLT_MAX, float(width), text);
    return {double(extent.x), double(extent.y)};
}

void ui_text_sized(struct ui *u, int face, double size, struct ui_box box, uint32_t color, const char *text)
{
    const ui_point extent = ui_text_extent(u, face, size, text, box.w);
    mark(u, true, text, {box.x, box.y, extent.x, extent.y});
    u->draw_list->AddText(font_of(u, face), float(size), first(box), to_imgui_color(color), text, nullptr,
                          float(box.w));
}

void ui_clip(struct ui *u, struct ui_box box)
{
    ImGui::PushClipRect(first(box), last(box), true);
    (void)u;
}

void ui_unclip(struct ui *u)
{
    ImGui::PopClipRect();
    (void)u;
}

// ---------------------------------------------------------------- touch

struct ui_touch ui_area(struct ui *u, const char *name, struct ui_box box)
{
    ui_touch touch = {};
    if (box.w <= 0 || box.h <= 0)
        return touch;
    const bool was = ImGui::IsAnyItemActive();
    ImGui::SetCursorScreenPos(first(box));
    touch.tapped = ImGui::InvisibleButton(name, at(box.w, box.h));
    touch.over =
        ImGui::IsItemHovered(ImGuiHoveredFlags_AllowWhenBlockedByActiveItem) && (!was || ImGui::IsItemActive());
    touch.held = ImGui::IsItemActive();
    touch.went_down = ImGui::IsItemActivated();
    const ImVec2 pointer = ImGui::GetIO().MousePos;
    touch.x = double(pointer.x) - box.x;
    touch.y = double(pointer.y) - box.y;
    mark(u, false, name, box);
    note_rest(u, &touch);
    return touch;
}

bool ui_comes_to_rest(const struct ui *u) { return u->rest_id && u->now_ns - u->rest_ns < REST_NS; }

struct ui_pointer ui_pointer_now(const struct ui *u)
{
    (void)u;
    const ImGuiIO &io = ImGui::GetIO();
    const bool there = io.MousePos.x > -FLT_MAX;
    return {there ? double(io.MousePos.x) : 0, there ? double(io.MousePos.y) : 0, there, io.MouseDown[0]};
}

const struct ui_mark *ui_marks(const struct ui *u, int *count)
{
    *count = int(u->marks.size());
    return u->marks.data();
}
}
