/* Fast Local Regression in a C program of one's own: the four kernels of kernels_cl/, in order.
 *
 *   cc host.c -lOpenCL -lm -o host
 *   ./host KERNELS_CL WIDTH HEIGHT light.raw guides.raw denoised.raw
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

enum { Q = 5, C = 3, BLOCK = 8, WIDTH = 8, SUPPORT = 48 };
enum { K = (Q + 1) * (Q + 2) / 2 + (Q + 1) * C }; /* moment planes, kernels_cl/sizes.h */
static const float SIGMA = 15.0f, EPS = 1.3e-5f, EPS_PRIME = 6.5e-3f;

static cl_context context;
static cl_command_queue queue;
static cl_device_id device;

static void check(cl_int status, const char *what)
{
    if (status == CL_SUCCESS) return;
    fprintf(stderr, "%s: OpenCL error %d\n", what, status);
    exit(1);
}

static int up(int value, int step) { return (value + step - 1) / step; }

/* A file of kernels, built with all defines: those that it does not know do nothing. */
static cl_program build(const char *folder, const char *file)
{
    char options[8192], source[64], log[16384];
    snprintf(source, sizeof source, "#include \"%s\"\n", file);
    snprintf(options, sizeof options,
        "-I %s -DQ=%d -DC=%d -DPART_0=%d -DPART_1=0 -DPART_2=0 -DPART_3=0 -DPART_4=0"
        " -DBLOCK=%d -DSTEP=%d -DWIDTH=%d", folder, Q, C, Q, BLOCK, BLOCK, WIDTH);
    const char *text = source;
    cl_int status;
    cl_program program = clCreateProgramWithSource(context, 1, &text, NULL, &status);
    check(status, file);
    if (clBuildProgram(program, 1, &device, options, NULL, NULL) != CL_SUCCESS) {
        clGetProgramBuildInfo(program, device, CL_PROGRAM_BUILD_LOG, sizeof log, log, NULL);
        fprintf(stderr, "%s: %s\n", file, log);
        exit(1);
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
            check(clSetKernelArg(kernel, i, sizeof integer, &integer), "argument");
        } else if (types[i] == 'f') {
            number = (float)va_arg(list, double);
            check(clSetKernelArg(kernel, i, sizeof number, &number), "argument");
        } else {
            buffer = va_arg(list, cl_mem);
            check(clSetKernelArg(kernel, i, sizeof buffer, &buffer), "argument");
        }
    }
    va_end(list);
    const size_t size[3] = {x, y, z};
    check(clEnqueueNDRangeKernel(queue, kernel, 3, NULL, size, NULL, 0, NULL, NULL), "kernel");
}

static cl_mem buffer(size_t floats, float *values)
{
    cl_int status;
    const cl_mem_flags flags = CL_MEM_READ_WRITE | (values ? CL_MEM_COPY_HOST_PTR : 0);
    cl_mem made = clCreateBuffer(context, flags, floats * sizeof(float), values, &status);
    check(status, "buffer");
    return made;
}

static float *read_floats(const char *path, size_t count)
{
    float *values = malloc(count * sizeof(float));
    FILE *file = fopen(path, "rb");
    if (!values || !file || fread(values, sizeof(float), count, file) != count) {
        fprintf(stderr, "%s does not hold %zu floats\n", path, count);
        exit(1);
    }
    fclose(file);
    return values;
}

int main(int argc, char **argv)
{
    if (argc != 7) {
        fprintf(stderr, "use: host KERNELS_CL WIDTH HEIGHT light.raw guides.raw denoised.raw\n");
        return 2;
    }
    const int width = atoi(argv[2]), height = atoi(argv[3]);
    const size_t pixels = (size_t)width * height;

    cl_platform_id platform;
    cl_int status;
    check(clGetPlatformIDs(1, &platform, NULL), "no OpenCL platform");
    check(clGetDeviceIDs(platform, CL_DEVICE_TYPE_ALL, 1, &device, NULL), "no OpenCL device");
    context = clCreateContext(NULL, 1, &device, NULL, NULL, &status);
    check(status, "context");
    queue = clCreateCommandQueue(context, device, 0, &status);
    check(status, "queue");

    /* Sizes: h x w blocks, rows of them `pitch` apart, a margin for the window on either side. */
    const int h = up(height, BLOCK), w = up(width, BLOCK), pitch = up(w, WIDTH) * WIDTH;
    const int reach = up(SUPPORT, BLOCK), margin = up(reach, WIDTH) * WIDTH;
    const int step_x = width / 32 > 1 ? width / 32 : 1, step_y = height / 32 > 1 ? height / 32 : 1;
    const int rows = up(height, step_y), wide = pitch + 2 * margin;

    float taps[2 * (SUPPORT / BLOCK) + 1], sum = 0;
    for (int t = -reach; t <= reach; ++t)
        sum += taps[t + reach] = expf(-0.5f * t * t * BLOCK * BLOCK / (SIGMA * SIGMA));
    for (int t = 0; t <= 2 * reach; ++t) taps[t] /= sum;

    cl_mem light = buffer(C * pixels, read_floats(argv[4], C * pixels));
    cl_mem guides = buffer(Q * pixels, read_floats(argv[5], Q * pixels));
    cl_mem window = buffer(2 * reach + 1, taps), shift = buffer(Q, NULL);
    cl_mem partial = buffer((size_t)rows * Q * 2, NULL);
    cl_mem moments = buffer((size_t)K * h * pitch, NULL), columns = buffer((size_t)K * h * wide, NULL);
    cl_mem blurred = buffer((size_t)K * h * pitch, NULL), output = buffer(C * pixels, NULL);
    cl_mem model = buffer((size_t)(Q + 1) * C * h * pitch, NULL);
    const cl_program centre_cl = build(argv[1], "centre.cl"), moments_cl = build(argv[1], "moments.cl");
    const cl_program blur_cl = build(argv[1], "blur.cl");
    const cl_program solve_cl = build(argv[1], "solve.cl"), apply_cl = build(argv[1], "apply.cl");
    const cl_mem none = NULL; /* images of guides that are not used, and no weight */

    run(centre_cl, "centre_rows", rows, 1, 1, "iiiibbbbbbb",
        width, rows, step_x, step_y, guides, none, none, none, none, none, partial);
    run(centre_cl, "centre", Q, 1, 1, "ibb", rows, partial, shift);
    run(moments_cl, "moments", pitch, h, 1, "iiiibbbbbbbbb",
        width, height, h, pitch, light, guides, none, none, none, none, none, shift, moments);
    run(blur_cl, "blur_columns", wide / WIDTH, h, K, "iiiiibbb",
        K, h, pitch, margin, reach, window, moments, columns);
    run(blur_cl, "blur_rows", pitch / WIDTH, h, K, "iiiiibbb",
        K, h, pitch, margin, reach, window, columns, blurred);
    run(solve_cl, "solve", pitch / WIDTH, h, 1, "iiffbbb",
        h, pitch, EPS, EPS_PRIME, shift, blurred, model);
    run(apply_cl, "apply", (w + 1) * up(BLOCK, WIDTH), h + 1, 1, "iiiiibbbbbbbb",
        width, height, h, w, pitch, model, guides, none, none, none, none, shift, output);

    float *denoised = malloc(C * pixels * sizeof(float));
    check(clEnqueueReadBuffer(queue, output, CL_TRUE, 0, C * pixels * sizeof(float), denoised,
        0, NULL, NULL), "reading the result");
    FILE *file = fopen(argv[6], "wb");
    if (!file || fwrite(denoised, sizeof(float), C * pixels, file) != C * pixels || fclose(file)) {
        fprintf(stderr, "%s cannot be written\n", argv[6]);
        return 1;
    }
    return 0;
}
