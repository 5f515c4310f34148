/* Writes to many sockets in one call, during which Python's interpreter lock is released: see sockets.py. */
#include "hric_core/python_numbers.h"

#include <errno.h>
#include <sys/socket.h>

/* Write as much as the socket accepts without waiting; return the number of bytes, or -errno. */
static Py_ssize_t send_now(int fd, const char *data, size_t size)
{
    size_t taken = 0;
    while (taken < size) {
        const ssize_t sent = send(fd, data + taken, size - taken, MSG_NOSIGNAL | MSG_DONTWAIT);
        if (sent >= 0)
            taken += (size_t)sent;
        else if (errno == EAGAIN || errno == EWOULDBLOCK)
            break;
        else if (errno != EINTR)
            return -errno;
    }
    return (Py_ssize_t)taken;
}

static PyObject *send_now_all(PyObject *Py_UNUSED(module), PyObject *args)
{
    PyObject *fds, *parts;
    if (!PyArg_ParseTuple(args, "O!O!", &PyList_Type, &fds, &PyList_Type, &parts))
        return NULL;
    const Py_ssize_t n = PyList_GET_SIZE(fds);
    if (PyList_GET_SIZE(parts) != n) {
        PyErr_SetString(PyExc_ValueError, "send_now needs as many byte strings as sockets");
        return NULL;
    }
    int *fd = PyMem_Calloc((size_t)n + 1, sizeof(int));
    Py_ssize_t *sent = PyMem_Calloc((size_t)n + 1, sizeof(Py_ssize_t));
    Py_buffer *part = PyMem_Calloc((size_t)n + 1, sizeof(Py_buffer));
    PyObject *results = NULL;
    Py_ssize_t held = 0;
    if (fd == NULL || sent == NULL || part == NULL) {
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
        sent[i] = send_now(fd[i], part[i].buf, (size_t)part[i].len);
    PyEval_RestoreThread(interpreter);
    results = PyList_New(n);
    for (Py_ssize_t i = 0; results != NULL && i < n; i++) {
        PyObject *number = PyLong_FromSsize_t(sent[i]);
        if (number == NULL)
            Py_CLEAR(results);
        else
            PyList_SET_ITEM(results, i, number);
    }
end:
    for (Py_ssize_t i = 0; i < held; i++)
        PyBuffer_Release(&part[i]);
    PyMem_Free(fd);
    PyMem_Free(sent);
    PyMem_Free(part);
    return results;
}

static PyMethodDef functions[] = {
    {"send_now", send_now_all, METH_VARARGS,
     "send_now(file descriptors, bytes for each): return the number of bytes written to each, or -errno"},
    {0}};

MODULE(hric_sending, functions)
