// SPDX-License-Identifier: Apache-2.0
/* Fast Local Regression in a C program of one's own: the kernels of kernels_cl/, in order.
 *
 *   cc host.c -lOpenCL -lm -o host
 *   ./host KERNELS_CL flr|flr-adaptive WIDTH HEIGHT light.raw guides.raw denoised.raw
 *
 * The raw files are 32-bit floats: light (H, W, 3), demodulated; guides (H, W, 5): normal, depth
 * divided by its median, ambient occlusion. `denoised` gets (H, W, 3).
 */
#define CL_TARGET_OPENCL_VERSION 120
#include <CL/cl.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { Q = 5, C = 3, BLOCK = 8, LARGEST = 32768 };
enum { XX = (Q + 1) * (Q + 2) / 2, K = XX + (Q + 1) * C }; /* moment planes, kernels_cl/sizes.h */

static cl_context context;
static cl_command_queue queue;
static cl_device_id device;
static const char *folder;
static int lanes; /* WIDTH of kernels_cl/vectors.h */
static int width, height;
static cl_mem light, guides, shift; /* the result is written over the light */
static const cl_mem none = NULL; /* images of guides that are not used, and no weight */

static void fail(int code, const char *format, ...)
{
    va_list list;
    va_start(list, format);
    vfprintf(stderr, format, list);
    va_end(list);
    fputc('\n', stderr);
    exit(code);
}

static void check(cl_int status, const char *what)
{
    if (status != CL_SUCCESS) fail(1, "%s: OpenCL error %d", what, status);
}

static int up(int value, int step) { return (value + step - 1) / step; }

/* A file of kernels, built for so many channels, with `more` defines; those that it does not know do
 * nothing. */
static cl_program build(const char *file, int channels, const char *more)
{
    char options[8192], source[64], log[16384];
    snprintf(source, sizeof source, "#include \"%s\"\n", file);
    const int length = snprintf(options, sizeof options,
        "-I %s -DQ=%d -DC=%d -DPART_0=%d -DPART_1=0 -DPART_2=0 -DPART_3=0 -DPART_4=0 -DWIDTH=%d"
        " -DREACH=5 -DROUNDING=64 -DDOWN=0 -DPROPORTIONAL %s",
        folder, Q, channels, Q, lanes, more);
    if (length >= (int)sizeof options) fail(2, "%s is too long a path", folder);
    const char *text = source;
    cl_int status;
    cl_program program = clCreateProgramWithSource(context, 1, &text, NULL, &status);
    check(status, file);
    if (clBuildProgram(program, 1, &device, options, NULL, NULL) != CL_SUCCESS) {
        clGetProgramBuildInfo(program, device, CL_PROGRAM_BUILD_LOG, sizeof log, log, NULL);
        fail(1, "%s: %s", file, log);
    }
    return program;
}

/* Enqueue a kernel with arguments of `types`: i int, f float, b buffer (NULL: what is not used). */
static void run(cl_program program, const char *name, size_t x, size_t y, size_t z,
    const char *types, ...)
{
    cl_int status;
    cl_kernel kernel = clCreateKernel(program, name, &status);
    check(status, name);
    va_list list;
    va_start(list, types);
    for (cl_uint i = 0; types[i]; ++i) {
        cl_int integer;
        cl_float number;
        cl_mem buffer;
        if (types[i] == 'i') {
            integer = va_arg(list, int);
            check(clSetKernelArg(kernel, i, sizeof integer, &integer), name);
        } else if (types[i] == 'f') {
            number = (float)va_arg(list, double);
            check(clSetKernelArg(kernel, i, sizeof number, &number), name);
        } else {
            buffer = va_arg(list, cl_mem);
            check(clSetKernelArg(kernel, i, sizeof buffer, &buffer), name);
        }
    }
    va_end(list);
    const size_t size[3] = {x, y, z};
    check(clEnqueueNDRangeKernel(queue, kernel, 3, NULL, size, NULL, 0, NULL, NULL), name);
    clReleaseKernel(kernel);
}

static cl_mem buffer(size_t floats, float *values)
{
    cl_int status;
    const cl_mem_flags flags = CL_MEM_READ_WRITE | (values ? CL_MEM_COPY_HOST_PTR : 0);
    cl_mem made = clCreateBuffer(context, flags, floats * sizeof(float), values, &status);
    check(status, "buffer");
    return made;
}

/* What guides are measured from: their means over some thousand pixels. */
static void centre(void)
{
    const int step_x = width / 32 > 1 ? width / 32 : 1, step_y = height / 32 > 1 ? height / 32 : 1;
    const int rows = up(height, step_y);
    const cl_program program = build("centre.cl", 1, "-DBLOCK=8");
    cl_mem partial = buffer((size_t)rows * Q * 2, NULL);
    run(program, "centre_rows", rows, 1, 1, "iiiibbbbbbb",
        width, rows, step_x, step_y, guides, none, none, none, none, none, partial);
    run(program, "centre", Q, 1, 1, "ibb", rows, partial, shift);
}

/* The moments of h x w blocks of BLOCK pixels, rows of them `pitch` apart. */
static cl_mem collect(int channels, const char *defines, int h, int pitch)
{
    cl_mem moments = buffer((size_t)(XX + (Q + 1) * channels) * h * pitch, NULL);
    run(build("moments.cl", channels, defines), "moments", pitch, h, 1, "iiiibbbbbbbbb",
        width, height, h, pitch, light, guides, none, none, none, none, none, shift, moments);
    return moments;
}

static void flr(void)
{
    const float sigma = 15.0f, eps = 1.3e-5f, eps_prime = 6.5e-3f;
    enum { REACH = 48 / BLOCK }; /* the window ends 48 pixels away */

    const int h = up(height, BLOCK), w = up(width, BLOCK), pitch = up(w, lanes) * lanes;
    const int margin = up(REACH, lanes) * lanes, wide = pitch + 2 * margin;
    float taps[2 * REACH + 1], sum = 0;
    for (int t = -REACH; t <= REACH; ++t)
        sum += taps[t + REACH] = expf(-0.5f * t * t * BLOCK * BLOCK / (sigma * sigma));
    for (int t = 0; t <= 2 * REACH; ++t) taps[t] /= sum;

    cl_mem window = buffer(2 * REACH + 1, taps), blurred = buffer((size_t)K * h * pitch, NULL);
    cl_mem columns = buffer((size_t)K * h * wide, NULL);
    cl_mem model = buffer((size_t)(Q + 1) * C * h * pitch, NULL);
    const cl_program blur_cl = build("blur.cl", C, "");

    cl_mem moments = collect(C, "-DBLOCK=8", h, pitch);
    run(blur_cl, "blur_columns", wide / lanes, h, K, "iiiiibbb",
        K, h, pitch, margin, REACH, window, moments, columns);
    run(blur_cl, "blur_rows", pitch / lanes, h, K, "iiiiibbb",
        K, h, pitch, margin, REACH, window, columns, blurred);
    run(build("solve.cl", C, ""), "solve", pitch / lanes, h, 1, "iiffbbb",
        h, pitch, eps, eps_prime, shift, blurred, model);
    run(build("apply.cl", C, "-DSTEP=8"), "apply", (w + 1) * (BLOCK / lanes), h + 1, 1,
        "iiiiibbbbbbbb",
        width, height, h, w, pitch, model, guides, none, none, none, none, shift, light);
}

/* Adaptive FLR works on grids of blocks, kernels_cl/grids.h: (h, pitch / GROUP, count, GROUP). */
enum { GROUP = 8, LEVELS = 4, FINEST = BLOCK / 2 };
static const float SIGMA = 2, GUIDE_SCALE = 2, CAUTION = 1;
/* What the channels count in the brightness: as in luminance, and of brightness itself. */
#define LUMINANCE " -DBRIGHTNESS_0=0.2126f -DBRIGHTNESS_1=0.7152f -DBRIGHTNESS_2=0.0722f"
#define ITSELF " -DBRIGHTNESS_0=1.0f -DBRIGHTNESS_1=1.0f -DBRIGHTNESS_2=1.0f"

typedef struct {
    cl_mem planes;
    int count, h, w, pitch;
} grid;

/* A level: its moments, what ends its windows, its models, and whether there is a coarser one. */
typedef struct {
    grid moments, features, models;
    int refines;
} level;

static grid new_grid(int count, int h, int w)
{
    grid made = {NULL, count, h, w, up(w, GROUP) * GROUP};
    made.planes = buffer((size_t)count * h * made.pitch, NULL);
    return made;
}

/* Models of so many channels, kernels_cl/models.h. */
static grid new_models(int channels, int h, int w) { return new_grid((Q + 1) * (channels + 1) + 1, h, w); }

/* Means of 2 x 2 blocks; of what lies as `row`, `group` and `plane` say, in floats. */
static grid halve(cl_program program, grid g, int row, int group, int plane)
{
    const grid half = new_grid(g.count, up(g.h, 2), up(g.w, 2));
    run(program, "halve", half.pitch / lanes, half.h, 1, "iiiiiiiibb",
        g.count, g.h, g.pitch, row, group, plane, half.h, half.pitch, g.planes, half.planes);
    return half;
}

static grid halve_grid(cl_program program, grid g)
{
    return halve(program, g, g.pitch * g.count, GROUP * g.count, GROUP);
}

/* Fit a level of blocks of `side` pixels. found: models of the coarser levels, if there are any.
 * positions: whether the position in the window is two more guides. */
static level fit(cl_program program, grid moments, int channels, int positions, int side,
    const grid *found, cl_mem mean)
{
    const float brightness_scale = 2, eps = 1e-4f, noise_ridge = 0.07f, position_ridge = 0.2f;
    const int h = moments.h, w = moments.w, pitch = moments.pitch, refines = found != NULL;
    const grid no = {NULL, 0, 0, 0, 0}, coarse = found ? *found : no;
    const grid features = new_grid(Q + 2 * refines, h, w), models = new_models(channels, h, w);
    const grid rows = new_grid(moments.count + positions * (Q + channels + 2), h, w);

    run(program, "features", pitch / lanes, h, 1, "iiiiiiffbbbbb",
        h, pitch, refines, coarse.h, coarse.w, coarse.pitch, GUIDE_SCALE, brightness_scale, none,
        mean, moments.planes, coarse.planes, features.planes);
    run(program, "window_rows", pitch / lanes, h, 1, "iiifbbbb",
        h, pitch, refines, SIGMA, none, features.planes, moments.planes, rows.planes);
    run(program, "fit", pitch / lanes, h, 1, "iiiifffffbbbbbb",
        h, pitch, refines, side, SIGMA, eps, eps, noise_ridge, position_ridge, none, mean, shift,
        features.planes, rows.planes, models.planes);
    return (level){moments, features, models, refines};
}

/* Models `merged + share (fine - coarse)`, where `share` of the difference is signal. */
static grid merge(cl_program merge_cl, cl_program halve_cl, level fine, level coarse, grid merged,
    cl_mem mean)
{
    const int h = fine.models.h, w = fine.models.w, pitch = fine.models.pitch;
    const grid signal = new_grid(3, h, w), models = coarse.models, result = new_models(C, h, w);
    run(merge_cl, "signal", pitch / lanes, h, 1, "iiiiifbbbbbbb",
        h, pitch, models.h, models.w, models.pitch, GUIDE_SCALE, none, mean, fine.moments.planes,
        fine.features.planes, fine.models.planes, models.planes, signal.planes);

    const grid half = halve_grid(halve_cl, signal), share = new_grid(1, half.h, half.w);
    const grid rows = new_grid(3, half.h, half.w);
    run(merge_cl, "share_rows", half.pitch / lanes, half.h, 1, "iiifbbb",
        half.h, half.pitch, coarse.refines, SIGMA, coarse.features.planes, half.planes, rows.planes);
    run(merge_cl, "share_columns", half.pitch / lanes, half.h, 1, "iiiffbbb", half.h, half.pitch,
        coarse.refines, SIGMA, CAUTION, coarse.features.planes, rows.planes, share.planes);
    run(merge_cl, "merge", pitch / lanes, h, 1, "iiiiibbbbbb",
        h, pitch, models.h, models.w, models.pitch, none, fine.models.planes, models.planes,
        merged.planes, share.planes, result.planes);
    return result;
}

/* The defaults of docs/adaptive.md. Light above 1e15 is to be divided by a power of two first. */
static void flr_adaptive(void)
{
    const float exponent = 1, offset = 0.2f, slack = 0.025f, least = 0.2f;
    const cl_program halve_cl = build("resampling.cl", C, ""), energy_cl = build("energy.cl", C, LUMINANCE);
    const cl_program merge_cl = build("merge.cl", C, LUMINANCE);
    const cl_program pilot_cl = build("level.cl", 1, "-DNOISE=0 -DPOSITIONS=1" ITSELF);
    const cl_program level_cl = build("level.cl", C, "-DNOISE=1 -DPOSITIONS=1" LUMINANCE);
    const cl_program finest_cl = build("level.cl", C, "-DNOISE=1 -DPOSITIONS=0" LUMINANCE);

    /* Pass 1: the brightness, on blocks of 8 x 8, its mean over the frame and a first fit. */
    const int h = up(height, BLOCK), w = up(width, BLOCK), pitch = up(w, GROUP) * GROUP;
    grid pass = {collect(1, "-DBLOCK=8 -DLIGHT=3" LUMINANCE, h, pitch), XX + Q + 1, h, w, pitch};
    cl_mem partial = buffer((size_t)h * 2, NULL), mean = buffer(2, NULL), rate = buffer(1, NULL);
    run(energy_cl, "light_rows", h, 1, 1, "iiibb", h, w, pitch, pass.planes, partial);
    run(energy_cl, "light_mean", 1, 1, 1, "ibb", h, partial, mean);
    const grid halved = halve(halve_cl, pass, pitch, GROUP, h * pitch);
    const grid pilot = fit(pilot_cl, halved, 1, 1, 2 * BLOCK, NULL, mean).models;

    /* Pass 2: all channels, weighed, on blocks of 4 x 4; then a grid half as fine per level. */
    grid grids[LEVELS] = {new_grid(K + 1, up(height, FINEST), up(width, FINEST))};
    run(build("weighted_moments.cl", C, "-DBLOCK=4" LUMINANCE), "weighted_moments",
        grids[0].pitch / (lanes > FINEST ? 2 : 1), grids[0].h, 1, "iiiiiiiffbbbbbbbbbbb",
        width, height, grids[0].h, grids[0].pitch, pilot.h, pilot.w, pilot.pitch, exponent, offset,
        light, guides, none, none, none, none, none, shift, pilot.planes, mean, grids[0].planes);
    for (int i = 1; i < LEVELS; ++i) grids[i] = halve_grid(halve_cl, grids[i - 1]);

    /* From the coarsest grid to the finest. */
    level coarse = fit(level_cl, grids[LEVELS - 1], C, 1, FINEST << (LEVELS - 1), NULL, mean);
    grid merged = coarse.models;
    for (int i = LEVELS - 2; i >= 0; --i) {
        const level fine = fit(i ? level_cl : finest_cl, grids[i], C, i > 0, FINEST << i, &merged, mean);
        merged = merge(merge_cl, halve_cl, fine, coarse, merged, mean);
        coarse = fine;
    }

    /* Pass 3: the models on every pixel, with the brightness of the frame. */
    cl_mem restored = buffer((size_t)h * pitch, NULL);
    run(energy_cl, "restored", w, h, 1, "iiiiiibbb", h, w, pitch, merged.h, merged.w, merged.pitch,
        pass.planes, merged.planes, restored);
    run(energy_cl, "restored_rows", h, 1, 1, "iiibbb", h, w, pitch, pass.planes, restored, partial);
    run(energy_cl, "restore", 1, 1, 1, "ifbbb", h, slack, partial, mean, rate);
    const grid own = new_grid(C, merged.h, merged.w);
    run(energy_cl, "own_light", merged.pitch / lanes, merged.h, 1, "iibbb",
        merged.h, merged.pitch, grids[0].planes, merged.planes, own.planes);
    const int strips = lanes > FINEST ? up(merged.w + 1, lanes / FINEST) : (merged.w + 1) * FINEST;
    run(build("apply.cl", C, "-DSTEP=4 -DRESTORED" LUMINANCE), "apply", strips, merged.h + 1, 1,
        "iiiiibbbbbbbbibbbf",
        width, height, merged.h, merged.w, merged.pitch, merged.planes, guides, none, none, none,
        none, shift, light, pitch, rate, restored, own.planes, least);
}

static float *read_floats(const char *path, size_t count)
{
    float *values = malloc(count * sizeof(float));
    FILE *file = fopen(path, "rb");
    if (!values || !file || fread(values, sizeof(float), count, file) != count || fgetc(file) != EOF)
        fail(1, "%s does not hold %zu floats", path, count);
    fclose(file);
    return values;
}

static int size(const char *text, const char *what)
{
    char *end;
    const long value = strtol(text, &end, 10);
    if (end == text || *end || value < 1 || value > LARGEST)
        fail(2, "%s must be a whole number from 1 to %d, not %s", what, LARGEST, text);
    return (int)value;
}

int main(int argc, char **argv)
{
    const int adaptive = argc == 8 && !strcmp(argv[2], "flr-adaptive");
    if (argc != 8 || (!adaptive && strcmp(argv[2], "flr")))
        fail(2, "use: host KERNELS_CL flr|flr-adaptive WIDTH HEIGHT light.raw guides.raw denoised.raw");
    folder = argv[1];
    width = size(argv[3], "WIDTH");
    height = size(argv[4], "HEIGHT");
    const size_t pixels = (size_t)width * height;
    float *of_light = read_floats(argv[5], C * pixels), *of_guides = read_floats(argv[6], Q * pixels);

    cl_platform_id platform;
    cl_device_type type;
    cl_int status;
    check(clGetPlatformIDs(1, &platform, NULL), "no OpenCL platform");
    check(clGetDeviceIDs(platform, CL_DEVICE_TYPE_ALL, 1, &device, NULL), "no OpenCL device");
    check(clGetDeviceInfo(device, CL_DEVICE_TYPE, sizeof type, &type, NULL), "device");
    context = clCreateContext(NULL, 1, &device, NULL, NULL, &status);
    check(status, "context");
    queue = clCreateCommandQueue(context, device, 0, &status);
    check(status, "queue");
    lanes = type & CL_DEVICE_TYPE_CPU ? 8 : 1;

    light = buffer(C * pixels, of_light);
    guides = buffer(Q * pixels, of_guides);
    shift = buffer(Q, NULL);
    centre();
    adaptive ? flr_adaptive() : flr();

    float *denoised = of_light;
    check(clEnqueueReadBuffer(queue, light, CL_TRUE, 0, C * pixels * sizeof(float), denoised,
        0, NULL, NULL), "reading the result");
    FILE *file = fopen(argv[7], "wb");
    if (!file || fwrite(denoised, sizeof(float), C * pixels, file) != C * pixels || fclose(file))
        fail(1, "%s cannot be written", argv[7]);
    return 0;
}
