/* The kernels as functions of Python, by the stable ABI of 3.11. Arguments are checked against the types that a kernel
   was compiled for and flattened as numba flattens them; the kernel runs without the GIL.

   The module has ALL (a dict from the full name of a kernel to its function), Unfit (raised where no signature fits),
   and SOURCES and FILES, BUILD and BUILD_FILES, by which `inercal.foundation._jit` knows whether it is stale. */
#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030B0000
#include <Python.h>
#include <stdint.h>
#include <string.h>

typedef int32_t (*Native)(const int64_t *, void *);
typedef struct { const char *name, *arguments, *result; Native call; } Entry;
#include "entries.inc"

/* Words of the arguments so far, and the buffers that are held until the call is over. */
typedef struct { int64_t words[WORDS]; int used, count; Py_buffer held[ARRAYS]; } Flat;

static PyObject *unfit;

static int item_fits(char wanted, const Py_buffer *view) {
    const char *f = view->format ? view->format : "B";
    while (*f == '@' || *f == '=' || *f == '<') f++;
    if (*f == 0 || f[1]) return 0;
    switch (wanted) {
    case 'w': return (*f == 'i' || *f == 'l') && view->itemsize == 4;
    case 'q': return (*f == 'l' || *f == 'q') && view->itemsize == 8;
    case 'Q': return (*f == 'L' || *f == 'Q') && view->itemsize == 8;
    default: return *f == wanted; /* d B ? */
    }
}

/* An array of the type at `*type`, which is moved on. */
static int flatten_array(PyObject *value, const char **type, Flat *out) {
    char item = *(*type)++, layout = 'C';
    int axes = *(*type)++ - '0', flags = PyBUF_FORMAT | PyBUF_STRIDES | PyBUF_WRITABLE;
    if (**type == 'F' || **type == 'A') layout = *(*type)++;
    if (**type == 'R') { flags &= ~PyBUF_WRITABLE; ++*type; }
    Py_buffer *view = &out->held[out->count];
    if (PyObject_GetBuffer(value, view, flags) != 0) { PyErr_Clear(); return 0; }
    out->count++;
    if (view->ndim != axes || !item_fits(item, view) || (uintptr_t)view->buf % (size_t)view->itemsize) return 0;
    if (layout != 'A' && view->len && !PyBuffer_IsContiguous(view, layout)) return 0;
    int64_t *w = out->words + out->used;
    w[0] = w[1] = 0; /* nobody's references are counted: Python holds the array */
    w[2] = view->len / view->itemsize;
    w[3] = view->itemsize;
    w[4] = (int64_t)(intptr_t)view->buf;
    for (int k = 0; k < axes; k++) { w[5 + k] = view->shape[k]; w[5 + axes + k] = view->strides[k]; }
    out->used += 5 + 2 * axes;
    return 1;
}

/* 1 where the value is of the type at `*type`, which is moved on, else 0; no error is left. */
static int flatten(PyObject *value, const char **type, Flat *out) {
    switch (**type) {
    case '(': {
        if (!PyTuple_Check(value)) return 0;
        Py_ssize_t n = PyTuple_Size(value);
        ++*type;
        for (Py_ssize_t k = 0; k < n; k++)
            if (**type == ')' || !flatten(PyTuple_GetItem(value, k), type, out)) return 0;
        return *(*type)++ == ')';
    }
    case 'f': {
        double x = PyFloat_AsDouble(value);
        if (x == -1.0 && PyErr_Occurred()) { PyErr_Clear(); return 0; }
        memcpy(&out->words[out->used++], &x, 8);
        break;
    }
    case 'i': {
        if (PyFloat_Check(value)) return 0;
        long long x = PyLong_AsLongLong(value);
        if (x == -1 && PyErr_Occurred()) { PyErr_Clear(); return 0; }
        out->words[out->used++] = x;
        break;
    }
    case 'b': {
        int x = PyObject_IsTrue(value);
        if (x < 0) { PyErr_Clear(); return 0; }
        out->words[out->used++] = x;
        break;
    }
    case 0: return 0;
    default: return flatten_array(value, type, out);
    }
    ++*type;
    return 1;
}

/* What a kernel returned, of the type at `*type`; NULL with an error set. */
static PyObject *returned(const char **type, const char **data) {
    char c = *(*type)++;
    if (c == 'n') Py_RETURN_NONE;
    if (c == 'b') return PyBool_FromLong(*(*data)++ & 1);
    if (c == '(') {
        PyObject *items[RETURNED];
        Py_ssize_t n = 0;
        for (; **type != ')'; n++)
            if (!(items[n] = returned(type, data))) break;
        PyObject *tuple = **type == ')' ? PyTuple_New(n) : NULL;
        for (Py_ssize_t k = 0; k < n; k++)
            if (tuple) PyTuple_SetItem(tuple, k, items[k]);
            else Py_DECREF(items[k]);
        ++*type;
        return tuple;
    }
    int64_t x;
    memcpy(&x, *data, 8);
    *data += 8;
    if (c == 'i') return PyLong_FromLongLong(x);
    double d;
    memcpy(&d, &x, 8);
    return PyFloat_FromDouble(d);
}

/* `self` is the number of the first signature of the kernel; the others follow it. */
static PyObject *call(PyObject *self, PyObject *const *arguments, Py_ssize_t n) {
    long first = PyLong_AsLong(self);
    const char *name = ENTRIES[first].name;
    for (long e = first; e < COUNT && strcmp(ENTRIES[e].name, name) == 0; e++) {
        int64_t result[RETURNED] = {0};
        Flat flat;
        flat.used = flat.count = 0;
        const char *type = ENTRIES[e].arguments;
        int fits = 1;
        for (Py_ssize_t k = 0; k < n && fits; k++) fits = flatten(arguments[k], &type, &flat);
        fits = fits && *type == 0;
        int32_t status = 0;
        if (fits) {
            Py_BEGIN_ALLOW_THREADS
            status = ENTRIES[e].call(flat.words, result);
            Py_END_ALLOW_THREADS
        }
        for (int k = 0; k < flat.count; k++) PyBuffer_Release(&flat.held[k]);
        if (!fits) continue;
        if (status != 0) { /* kernels raise nothing themselves */
            PyErr_Format(PyExc_ZeroDivisionError, "division by zero in %s", name);
            return NULL;
        }
        const char *data = (const char *)result;
        type = ENTRIES[e].result;
        return returned(&type, &data);
    }
    PyErr_SetString(unfit, name);
    return NULL;
}

static PyMethodDef METHODS[COUNT];
static struct PyModuleDef MODULE = {PyModuleDef_HEAD_INIT, "_kernels", NULL, -1, NULL, NULL, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit__kernels(void) {
    PyObject *module = PyModule_Create(&MODULE), *all = PyDict_New();
    if (!module || !all || !(unfit = PyErr_NewException("inercal._kernels.Unfit", PyExc_TypeError, NULL))) return NULL;
    for (long e = 0; e < COUNT; e++) {
        if (e && strcmp(ENTRIES[e].name, ENTRIES[e - 1].name) == 0) continue;
        METHODS[e].ml_name = ENTRIES[e].name;
        METHODS[e].ml_meth = (PyCFunction)(void (*)(void))call;
        METHODS[e].ml_flags = METH_FASTCALL;
        PyObject *self = PyLong_FromLong(e), *function = self ? PyCFunction_NewEx(&METHODS[e], self, NULL) : NULL;
        if (!function || PyDict_SetItemString(all, ENTRIES[e].name, function) != 0) return NULL;
        Py_DECREF(self);
        Py_DECREF(function);
    }
    if (PyModule_AddObjectRef(module, "ALL", all) != 0 || PyModule_AddObjectRef(module, "Unfit", unfit) != 0 ||
        PyModule_AddStringConstant(module, "SOURCES", SOURCES) != 0 ||
        PyModule_AddStringConstant(module, "FILES", FILES) != 0 ||
        PyModule_AddStringConstant(module, "BUILD", BUILD) != 0 ||
        PyModule_AddStringConstant(module, "BUILD_FILES", BUILD_FILES) != 0)
        return NULL;
    Py_DECREF(all);
    return module;
}

#if defined(__GNUC__)
__attribute__((visibility("hidden")))
#endif
/* A function of BLAS or LAPACK, from SciPy's capsules. */
void *scipy_function(const char *module, const char *name) {
    PyGILState_STATE gil = PyGILState_Ensure();
    PyObject *of = PyImport_ImportModule(module), *all = of ? PyObject_GetAttrString(of, "__pyx_capi__") : NULL;
    PyObject *capsule = all ? PyDict_GetItemString(all, name) : NULL;
    void *found = capsule ? PyCapsule_GetPointer(capsule, PyCapsule_GetName(capsule)) : NULL;
    if (!found) {
        PyErr_Print();
        Py_FatalError("inercal: SciPy has not the linear algebra that its kernels were compiled for");
    }
    Py_XDECREF(all);
    Py_XDECREF(of);
    PyGILState_Release(gil);
    return found;
}
