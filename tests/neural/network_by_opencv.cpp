#include "tests/neural/network_by_opencv.h"

#include <algorithm>
#include <cfloat>
#include <opencv2/dnn.hpp>
#include <stdexcept>
#include <string>
#include <vector>

// TFLite keeps images as [row][column][channel], OpenCV as [channel][row][column]: each tensor of four dimensions is
// kept here in OpenCV's order, all others as they are.
struct network_by_opencv {
    cv::dnn::Net net;
    std::vector<cv::String> output_layers;
    std::vector<tflite_tensor> output_shapes;
    tflite_tensor input_shape;
    std::vector<std::vector<float>> outputs;
};

namespace
{

using cv::dnn::DictValue;
using cv::dnn::LayerParams;

// What "same" padding adds before and after the image along one axis: the odd element goes after it.
struct margin {
    int before, after;
};

struct margin margin_of(const tflite_operator &o, int in, int out, int filter, int stride)
{
    const int missing = o.valid_padding ? 0 : std::max(0, (out - 1) * stride + filter - in);
    return {missing / 2, missing - missing / 2};
}

class builder
{
  public:
    builder(cv::dnn::Net &to, const tflite_model &from)
        : net(to), model(from), layer((size_t)from.tensor_count, NONE), name((size_t)from.tensor_count)
    {
        const int *size = model.tensors[model.input].size;
        net.setInputsNames({"input"});
        net.setInputShape("input", {1, size[3], size[1], size[2]});
        layer[(size_t)model.input] = 0; // the network's own layer
    }

    void build()
    {
        for (int i = 0; i < model.operator_count; i++) {
            const tflite_operator &o = model.operators[i];
            layer[(size_t)o.output] = activated(layer_of(o), o.activation);
            name[(size_t)o.output] = last_name;
        }
    }

    cv::String name_of(int tensor) const { return name[(size_t)tensor]; }

  private:
    enum { NONE = -1 };
    cv::dnn::Net &net;
    const tflite_model &model;
    std::vector<int> layer;       // that makes each tensor
    std::vector<cv::String> name; // of that layer
    cv::String last_name;
    int count = 0;

    const tflite_tensor &tensor(int i) const { return model.tensors[i]; }

    int source(const tflite_operator &o, int which) const
    {
        const int found = which < o.input_count && o.input[which] >= 0 ? layer[(size_t)o.input[which]] : (int)NONE;
        if (found == NONE)
            throw std::invalid_argument("an operator's input is no computed tensor");
        return found;
    }

    int add(const char *type, LayerParams params, const std::vector<int> &sources)
    {
        params.type = type;
        params.name = last_name = std::to_string(count++) + type;
        const int id = net.addLayer(params.name, type, params);
        for (size_t i = 0; i < sources.size(); i++)
            net.connect(sources[i], 0, id, (int)i);
        return id;
    }

    int activated(int id, tflite_activation activation)
    {
        if (activation == TFLITE_NO_ACTIVATION)
            return id;
        return add(activation == TFLITE_RELU6 ? "ReLU6" : "ReLU", LayerParams(), {id});
    }

    int padded(int id, margin rows, margin columns, margin channels, float value)
    {
        const int margins[] = {0,           0,          channels.before, channels.after,
                               rows.before, rows.after, columns.before,  columns.after};
        LayerParams p;
        p.set("paddings", DictValue::arrayInt(margins, 8));
        p.set("value", value);
        return add("Padding", p, {id});
    }

    int permuted(int id, std::vector<int> order)
    {
        LayerParams p;
        p.set("order", DictValue::arrayInt(order.data(), (int)order.size()));
        return add("Permute", p, {id});
    }

    int reshaped(int id, std::vector<int> size)
    {
        LayerParams p;
        p.set("dim", DictValue::arrayInt(size.data(), (int)size.size()));
        return add("Reshape", p, {id});
    }

    // A filter that moves over the image. OpenCV 4.6 refuses padding that differs before and after, so a layer of its
    // own pads the image, with `outside`. Returns what the filter's layer gets.
    int windowed(const tflite_operator &o, int across, int down, float outside, LayerParams &p)
    {
        const tflite_tensor &in = tensor(o.input[0]), &out = tensor(o.output);
        const margin rows = margin_of(o, in.size[1], out.size[1], down, o.stride_y);
        const margin columns = margin_of(o, in.size[2], out.size[2], across, o.stride_x);
        p.set("kernel_h", down);
        p.set("kernel_w", across);
        p.set("stride_h", o.stride_y);
        p.set("stride_w", o.stride_x);
        const bool pads = rows.after > 0 || columns.after > 0;
        return pads ? padded(source(o, 0), rows, columns, {0, 0}, outside) : source(o, 0);
    }

    int convolution(const tflite_operator &o)
    {
        const bool depthwise = o.kind == TFLITE_DEPTHWISE_CONV_2D;
        const tflite_tensor &filter = tensor(o.input[1]);
        const int down = filter.size[1], across = filter.size[2];
        const int outputs = depthwise ? filter.size[3] : filter.size[0], inputs = depthwise ? 1 : filter.size[3];
        LayerParams p;
        const int from = windowed(o, across, down, 0, p);
        const int size[] = {outputs, inputs, down, across};
        cv::Mat weights(4, size, CV_32F);
        float *to = weights.ptr<float>();
        for (int k = 0; k < outputs; k++)
            for (int c = 0; c < inputs; c++)
                for (int tap = 0; tap < down * across; tap++)
                    *to++ = filter.values[depthwise ? tap * outputs + k : (k * down * across + tap) * inputs + c];
        p.blobs.push_back(weights);
        const bool has_bias = o.input_count > 2 && o.input[2] >= 0;
        if (has_bias)
            p.blobs.push_back(cv::Mat(1, outputs, CV_32F, tensor(o.input[2]).values).clone());
        p.set("bias_term", has_bias);
        p.set("num_output", outputs);
        p.set("group", depthwise ? outputs : 1);
        return add("Convolution", p, {from});
    }

    int max_pool(const tflite_operator &o)
    {
        LayerParams p;
        const int from = windowed(o, o.filter_x, o.filter_y, -FLT_MAX, p);
        p.set("pool", "max");
        p.set("ceil_mode", false);
        return add("Pooling", p, {from});
    }

    int resize(const tflite_operator &o)
    {
        const tflite_tensor &out = tensor(o.output);
        LayerParams p;
        p.set("interpolation", o.half_pixel_centers ? "opencv_linear" : "bilinear");
        p.set("height", out.size[1]);
        p.set("width", out.size[2]);
        return add("Resize", p, {source(o, 0)});
    }

    int pad(const tflite_operator &o)
    {
        const int32_t *by = tensor(o.input[1]).integers; // before and after, of each of TFLite's dimensions
        return padded(source(o, 0), {by[2], by[3]}, {by[4], by[5]}, {by[6], by[7]}, 0);
    }

    int reshape(const tflite_operator &o)
    {
        const tflite_tensor &in = tensor(o.input[0]), &out = tensor(o.output);
        int id = in.dimensions == 4 ? permuted(source(o, 0), {0, 2, 3, 1}) : source(o, 0);
        id = reshaped(id, std::vector<int>(out.size, out.size + out.dimensions));
        return out.dimensions == 4 ? permuted(id, {0, 3, 1, 2}) : id;
    }

    int concatenation(const tflite_operator &o)
    {
        static const int channels_first[] = {0, 2, 3, 1};
        const int dimensions = tensor(o.output).dimensions, axis = o.axis < 0 ? o.axis + dimensions : o.axis;
        std::vector<int> sources;
        for (int i = 0; i < o.input_count; i++)
            sources.push_back(source(o, i));
        LayerParams p;
        p.set("axis", dimensions == 4 ? channels_first[axis] : axis);
        return add("Concat", p, sources);
    }

    // Blocks of block x block pixels come from channels [row][column][channel].
    int depth_to_space(const tflite_operator &o)
    {
        const tflite_tensor &in = tensor(o.input[0]), &out = tensor(o.output);
        const int block = o.block, channels = out.size[3];
        const int id = reshaped(source(o, 0), {1, block, block, channels, in.size[1], in.size[2]});
        return reshaped(permuted(id, {0, 3, 4, 1, 5, 2}), {1, channels, out.size[1], out.size[2]});
    }

    int sum(const tflite_operator &o)
    {
        LayerParams p;
        p.set("operation", "sum");
        return add("Eltwise", p, {source(o, 0), source(o, 1)});
    }

    int layer_of(const tflite_operator &o)
    {
        switch (o.kind) {
        case TFLITE_CONV_2D:
        case TFLITE_DEPTHWISE_CONV_2D: return convolution(o);
        case TFLITE_MAX_POOL_2D: return max_pool(o);
        case TFLITE_RESIZE_BILINEAR: return resize(o);
        case TFLITE_PAD: return pad(o);
        case TFLITE_RESHAPE: return reshape(o);
        case TFLITE_CONCATENATION: return concatenation(o);
        case TFLITE_DEPTH_TO_SPACE: return depth_to_space(o);
        case TFLITE_ADD: return sum(o);
        case TFLITE_LOGISTIC: return add("Sigmoid", LayerParams(), {source(o, 0)});
        case TFLITE_DEQUANTIZE:
        case TFLITE_DENSIFY: break; // the reader folds them
        }
        throw std::invalid_argument("an operator has no layer");
    }
};

// From OpenCV's order to TFLite's.
std::vector<float> channels_last(const cv::Mat &blob, const tflite_tensor &shape)
{
    if (blob.total() != shape.count || blob.type() != CV_32F || !blob.isContinuous())
        throw std::runtime_error("an output has another size");
    const float *from = blob.ptr<float>();
    std::vector<float> to(from, from + shape.count);
    const size_t channels = shape.dimensions == 4 ? (size_t)shape.size[3] : 1, pixels = shape.count / channels;
    for (size_t i = 0; i < shape.count; i++)
        to[i % pixels * channels + i / pixels] = from[i];
    return to;
}

} // namespace

enum status network_by_opencv_open(struct network_by_opencv **out, const struct tflite_model *model)
{
    *out = nullptr;
    try {
        auto n = std::make_unique<network_by_opencv>();
        builder b(n->net, *model);
        b.build();
        n->net.setPreferableBackend(cv::dnn::DNN_BACKEND_OPENCV);
        n->net.setPreferableTarget(cv::dnn::DNN_TARGET_CPU);
        n->input_shape = model->tensors[model->input];
        for (int i = 0; i < model->output_count; i++) {
            n->output_layers.push_back(b.name_of(model->output[i]));
            n->output_shapes.push_back(model->tensors[model->output[i]]);
        }
        *out = n.release();
        return OK;
    } catch (const std::invalid_argument &e) {
        return fail(ERR_FORMAT, "%s", e.what());
    } catch (const std::exception &e) {
        return fail(ERR_SOLVER, "OpenCV: %s", e.what());
    }
}

void network_by_opencv_close(struct network_by_opencv **n)
{
    delete *n;
    *n = nullptr;
}

enum status network_by_opencv_run(struct network_by_opencv *n, const float *input)
{
    try {
        const int *size = n->input_shape.size;
        const cv::Mat image(size[1], size[2], CV_32FC(size[3]), const_cast<float *>(input));
        cv::setNumThreads(1);
        n->net.setInput(cv::dnn::blobFromImage(image));
        std::vector<cv::Mat> blobs;
        n->net.forward(blobs, n->output_layers);
        n->outputs.clear();
        for (size_t i = 0; i < n->output_shapes.size(); i++)
            n->outputs.push_back(channels_last(blobs.at(i), n->output_shapes[i]));
        return OK;
    } catch (const std::exception &e) {
        return fail(ERR_SOLVER, "OpenCV: %s", e.what());
    }
}

const float *network_by_opencv_output(const struct network_by_opencv *n, int i, size_t *count)
{
    const std::vector<float> &values = n->outputs[(size_t)i];
    *count = values.size();
    return values.data();
}
