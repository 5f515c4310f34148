/* Writes to many sockets in one call, without the interpreter in between: see sending.py. */
#include <Python.h>

#include <errno.h>
#include <poll.h>
#include <sys/socket.h>

/* A listener that takes nothing for so long is given up, as rospy does [ms]. */
static const int PATIENCE = 60000;

/* All of it; 0 or the error's number. */
static int write_all(int fd, const char *data, size_t size)
{
    while (size > 0) {
        const ssize_t sent = send(fd, data, size, MSG_NOSIGNAL | MSG_DONTWAIT);
        if (sent >= 0) {
            data += sent;
            size -= (size_t)sent;
        } else if (errno == EAGAIN || errno == EWOULDBLOCK) {
            struct pollfd writable = {.fd = fd, .events = POLLOUT};
            const int ready = poll(&writable, 1, PATIENCE);
            if (ready == 0)
                return ETIMEDOUT;
            if (ready < 0 && errno != EINTR)
                return errno;
        } else if (errno != EINTR) {
            return errno;
        }
    }
    return 0;
}

static PyObject *send_all(PyObject *Py_UNUSED(module), PyObject *args)
{
    PyObject *fds, *parts;
    if (!PyArg_ParseTuple(args, "O!O!", &PyList_Type, &fds, &PyList_Type, &parts))
        return NULL;
    const Py_ssize_t n = PyList_GET_SIZE(fds);
    if (PyList_GET_SIZE(parts) != n) {
        PyErr_SetString(PyExc_ValueError, "one part is needed for each socket");
        return NULL;
    }
    int *fd = PyMem_Calloc(2 * (size_t)n + 1, sizeof(int));
    Py_buffer *part = PyMem_Calloc((size_t)n + 1, sizeof(Py_buffer));
    PyObject *errors = NULL;
    Py_ssize_t held = 0;
    if (fd == NULL || part == NULL) {
        PyErr_NoMemory();
        goto end;
    }
    for (; held < n; held++) {
        fd[held] = (int)PyLong_AsLong(PyList_GET_ITEM(fds, held));
        if ((fd[held] == -1 && PyErr_Occurred() != NULL)
            || PyObject_GetBuffer(PyList_GET_ITEM(parts, held), &part[held], PyBUF_SIMPLE) < 0)
            goto end;
    }
    PyThreadState *interpreter = PyEval_SaveThread();
    for (Py_ssize_t i = 0; i < n; i++)
        fd[n + i] = write_all(fd[i], part[i].buf, (size_t)part[i].len);
    PyEval_RestoreThread(interpreter);
    errors = PyList_New(n);
    for (Py_ssize_t i = 0; errors != NULL && i < n; i++) {
        PyObject *number = PyLong_FromLong(fd[n + i]);
        if (number == NULL)
            Py_CLEAR(errors);
        else
            PyList_SET_ITEM(errors, i, number);
    }
end:
    for (Py_ssize_t i = 0; i < held; i++)
        PyBuffer_Release(&part[i]);
    PyMem_Free(fd);
    PyMem_Free(part);
    return errors;
}

static PyMethodDef functions[] = {
    {"send_all", send_all, METH_VARARGS, "(sockets' numbers, bytes for each) -> 0 or the error's number, for each"},
    {0}};

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT, "hric_sending", NULL, -1, functions, NULL, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit_hric_sending(void) { return PyModule_Create(&definition); }
