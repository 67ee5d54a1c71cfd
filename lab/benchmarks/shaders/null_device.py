"""Compile SPIR-V with a Vulkan driver, without a GPU, and write the driver's statistics of the machine code.

    python null_device.py DRIVER.so < request.json > answer.json

Needs the standard library alone: it is started with the Python, the C library and the environment that suit the driver.
The request is a list of programs, each {"comp": file} or {"vert": file, "frag": file}; the answer
lists for each a map of its last stage's statistics, with its machine code as `assembly`, or {"error": text}.
"""

import ctypes
import json
import os
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

Pointer, UInt, Size, Float = ctypes.c_void_p, ctypes.c_uint32, ctypes.c_size_t, ctypes.c_float
Text = ctypes.c_char * 256
VERTEX, FRAGMENT, COMPUTE = 1, 0x10, 0x20
CAPTURE = 0x40 | 0x80
"""Statistics, and internal representations."""
RGBA32F = 109
ATTRIBUTES = 16
STORAGE_BUFFERS, STORAGE_IMAGES, SAMPLED, UNIFORM_BUFFERS = range(0, 16), range(16, 32), range(32, 64), range(64, 80)
"""First binding of each kind, which glslang gets as an option (`lab.benchmarks.shaders.compiling`)."""
OLDEST_MESA = (23, 2)
"""Of Intel's driver before it some programs take minutes, or have no end."""
PROPERTY_BYTES = 824
"""Of VkPhysicalDeviceProperties, whose second number is the version of the driver."""
DESCRIPTOR_TYPES = ((STORAGE_BUFFERS, 7), (STORAGE_IMAGES, 3), (SAMPLED, 1), (UNIFORM_BUFFERS, 6))


def structure(name: str, fields: str) -> type[ctypes.Structure]:
    """A structure of C. `fields`: names with their kind, p pointer, u uint32, z size, f float, t text of 256 bytes."""
    kinds = {"p": Pointer, "u": UInt, "z": Size, "f": Float, "t": Text, "l": ctypes.c_uint64}
    pairs = [part.split(":") for part in fields.split()]
    return type(name, (ctypes.Structure,), {"_fields_": [(field_name, kinds[kind]) for field_name, kind in pairs]})


HEAD = "sType:u pNext:p "
Application = structure("Application", HEAD + "name:p version:u engine:p engineVersion:u api:u")
InstanceInfo = structure("InstanceInfo", HEAD + "flags:u application:p layers:u layer:p extensions:u extension:p")
QueueInfo = structure("QueueInfo", HEAD + "flags:u family:u count:u priorities:p")
DeviceInfo = structure(
    "DeviceInfo", HEAD + "flags:u queues:u queue:p layers:u layer:p extensions:u extension:p features:p"
)
ModuleInfo = structure("ModuleInfo", HEAD + "flags:u bytes:z code:p")
StageInfo = structure("StageInfo", HEAD + "flags:u stage:u module:p name:p constants:p")
Binding = structure("Binding", "binding:u type:u count:u stages:u samplers:p")
SetInfo = structure("SetInfo", HEAD + "flags:u count:u bindings:p")
LayoutInfo = structure("LayoutInfo", HEAD + "flags:u sets:u set:p ranges:u range:p")
ComputeInfo = structure(
    "ComputeInfo",
    HEAD
    + "flags:u padding:u stageType:u stageNext:p stageFlags:u stage:u module:p name:p constants:p layout:p base:p baseIndex:u",
)
VertexBinding = structure("VertexBinding", "binding:u stride:u rate:u")
VertexAttribute = structure("VertexAttribute", "location:u binding:u format:u offset:u")
VertexInfo = structure("VertexInfo", HEAD + "flags:u bindings:u binding:p attributes:u attribute:p")
AssemblyInfo = structure("AssemblyInfo", HEAD + "flags:u topology:u restart:u")
ViewportInfo = structure("ViewportInfo", HEAD + "flags:u viewports:u viewport:p scissors:u scissor:p")
RasterInfo = structure(
    "RasterInfo",
    HEAD + "flags:u clamp:u discard:u mode:u cull:u front:u bias:u constant:f limit:f slope:f width:f",
)
SampleInfo = structure("SampleInfo", HEAD + "flags:u samples:u shading:u least:f mask:p coverage:u one:u")
BlendAttachment = structure("BlendAttachment", "enable:u a:u b:u c:u d:u e:u f:u mask:u")
BlendInfo = structure("BlendInfo", HEAD + "flags:u logic:u op:u count:u attachment:p r:f g:f b:f a:f")
DynamicInfo = structure("DynamicInfo", HEAD + "flags:u count:u states:p")
TargetInfo = structure("TargetInfo", HEAD + "view:u count:u formats:p depth:u stencil:u")
GraphicsInfo = structure(
    "GraphicsInfo",
    HEAD + "flags:u stages:u stage:p vertex:p assembly:p tessellation:p viewport:p raster:p samples:p depth:p blend:p "
    "dynamic:p layout:p pass:p subpass:u base:p baseIndex:u",
)
PipelineInfo = structure("PipelineInfo", HEAD + "pipeline:p")
ExecutableInfo = structure("ExecutableInfo", HEAD + "pipeline:p index:u")
Executable = structure("Executable", HEAD + "stages:u name:t description:t subgroup:u")
Statistic = structure("Statistic", HEAD + "name:t description:t format:u value:l")
Representation = structure("Representation", HEAD + "name:t description:t isText:u bytes:z data:p")


class Features(ctypes.Structure):
    """Any structure of features: more of them than any has."""

    _fields_ = [("sType", UInt), ("pNext", Pointer), ("values", UInt * 64)]


class VulkanError(Exception):
    """A function that failed."""


def address(part: Any) -> int:
    """Return the address of a structure or an array; 0 for an empty one."""
    return ctypes.addressof(part)


class NullDevice:
    """Device of the driver whose pipelines have statistics."""

    def __init__(self, driver: str) -> None:
        """Raises OSError and VulkanError where the driver gives no device."""
        entry = ctypes.CDLL(driver)
        negotiated = UInt(5)
        entry.vk_icdNegotiateLoaderICDInterfaceVersion(ctypes.byref(negotiated))
        self._find = entry.vk_icdGetInstanceProcAddr
        self._find.restype, self._find.argtypes = Pointer, [Pointer, ctypes.c_char_p]
        self._referenced: list[Any] = []
        self._instance: Any = None
        version = 1 << 22 | 3 << 12
        application = Application(0, None, None, 0, None, 0, version)
        information = InstanceInfo(1, None, 0, address(application), 0, None, 0, None)
        self._instance = self._made("vkCreateInstance", information)
        count, devices = UInt(1), (Pointer * 1)()
        self.call("vkEnumeratePhysicalDevices", self._instance, ctypes.byref(count), devices)
        if not count.value:
            raise VulkanError("the driver has no device")
        physical = Pointer(devices[0])
        properties = (UInt * (PROPERTY_BYTES // 4))()
        self.call("vkGetPhysicalDeviceProperties", physical, ctypes.byref(properties), fails=False)
        mesa = properties[1] >> 22, properties[1] >> 12 & 0x3FF
        if mesa < OLDEST_MESA:
            raise VulkanError(f"it is of Mesa {mesa[0]}.{mesa[1]}")
        # All features, but for checked accesses, which OpenGL does not ask for.
        kinds = (1000059000, 49, 51, 53, 1000269000)
        features = [Features(kind) for kind in kinds]
        for part, following in pairwise(features):
            part.pNext = address(following)
        self.call("vkGetPhysicalDeviceFeatures2", physical, ctypes.byref(features[0]), fails=False)
        features[0].values[0] = 0
        priority = Float(1.0)
        queue = QueueInfo(2, None, 0, 0, 1, address(priority))
        names = (ctypes.c_char_p * 1)(b"VK_KHR_pipeline_executable_properties")
        given = DeviceInfo(3, address(features[0]), 0, 1, address(queue), 0, None, 1, address(names), None)
        self._device = self._made("vkCreateDevice", given, physical)
        bindings = [
            Binding(number, kind, 1, 0x7FFFFFFF, None) for places, kind in DESCRIPTOR_TYPES for number in places
        ]
        table = (Binding * len(bindings))(*bindings)
        descriptors = self._made(
            "vkCreateDescriptorSetLayout", SetInfo(32, None, 0, len(table), address(table)), self._device
        )
        sets = (Pointer * 1)(descriptors.value)
        self._layout = self._made(
            "vkCreatePipelineLayout", LayoutInfo(30, None, 0, 1, address(sets), 0, None), self._device
        )

    def call(self, name: str, *arguments: Any, fails: bool = True) -> None:
        """Call a function of Vulkan. Raises VulkanError."""
        place = self._find(self._instance, name.encode())
        if not place:
            raise VulkanError(f"the driver has no {name}")
        result = ctypes.CFUNCTYPE(ctypes.c_int if fails else None)(place)(*arguments)
        if fails and result < 0:
            raise VulkanError(f"{name} fails with {result}")

    def _made(self, name: str, information: ctypes.Structure, *owner: Any) -> Any:
        made = Pointer()
        self.call(name, *owner, ctypes.byref(information), None, ctypes.byref(made))
        return made

    def _module(self, file: str) -> Any:
        code = Path(file).read_bytes()
        words = ctypes.create_string_buffer(code, len(code))
        return self._made("vkCreateShaderModule", ModuleInfo(16, None, 0, len(code), address(words)), self._device)

    def _pipeline(self, kind: str, information: ctypes.Structure) -> Any:
        made = Pointer()
        self.call(
            f"vkCreate{kind}Pipelines", self._device, None, UInt(1), ctypes.byref(information), None, ctypes.byref(made)
        )
        return made

    def compute(self, file: str) -> Any:
        """The pipeline of a compute shader."""
        main = ctypes.c_char_p(b"main")
        stage = (18, None, 0, COMPUTE, self._module(file), ctypes.cast(main, Pointer), None)
        return self._pipeline("Compute", ComputeInfo(29, None, CAPTURE, 0, *stage, self._layout, None, 0))

    def graphics(self, vertex: str, fragment: str) -> Any:
        """The pipeline of a vertex and a fragment shader, which write one colour."""
        main = ctypes.cast(ctypes.c_char_p(b"main"), Pointer)
        files = ((VERTEX, vertex), (FRAGMENT, fragment))
        stages = (StageInfo * 2)(*(StageInfo(18, None, 0, bit, self._module(file), main, None) for bit, file in files))
        binding = VertexBinding(0, 16, 0)
        attributes = (VertexAttribute * ATTRIBUTES)(*(VertexAttribute(at, 0, RGBA32F, 0) for at in range(ATTRIBUTES)))
        formats, states, blend = (UInt * 1)(RGBA32F), (UInt * 2)(0, 1), BlendAttachment(mask=15)
        parts = {
            "pNext": TargetInfo(1000044002, None, 0, 1, address(formats), 126, 0),
            "vertex": VertexInfo(19, None, 0, 1, address(binding), ATTRIBUTES, address(attributes)),
            "assembly": AssemblyInfo(20, None, 0, 3, 0),
            "viewport": ViewportInfo(22, None, 0, 1, None, 1, None),
            "raster": RasterInfo(23, width=1.0),
            "samples": SampleInfo(24, samples=1),
            "blend": BlendInfo(26, count=1, attachment=address(blend)),
            "dynamic": DynamicInfo(27, None, 0, 2, address(states)),
        }
        information = GraphicsInfo(28, flags=CAPTURE, stages=2, stage=address(stages), layout=self._layout.value)
        for name, part in parts.items():
            setattr(information, name, address(part))
        return self._pipeline("Graphics", information)

    def _listed(self, name: str, given: ctypes.Structure, kind: type[ctypes.Structure], number: int) -> Any:
        count = UInt()
        self.call(name, self._device, ctypes.byref(given), ctypes.byref(count), None)
        values = (kind * count.value)(*(kind(number) for _ in range(count.value)))
        self.call(name, self._device, ctypes.byref(given), ctypes.byref(count), values)
        return values

    def statistics(self, pipeline: Any) -> dict[str, Any]:
        """Return the driver's statistics of the pipeline's last stage, at the widest subgroup."""
        prefix = "vkGetPipelineExecutable"
        given = PipelineInfo(1000269001, None, pipeline.value)
        stages = self._listed(f"{prefix}PropertiesKHR", given, Executable, 1000269002)
        last = max(range(len(stages)), key=lambda number: (stages[number].stages, number))
        executable_info = ExecutableInfo(1000269003, None, pipeline.value, last)
        statistics_of: dict[str, Any] = {"executable": stages[last].name.decode(), "subgroup": stages[last].subgroup}
        for statistic in self._listed(f"{prefix}StatisticsKHR", executable_info, Statistic, 1000269004):
            statistics_of[statistic.name.decode()] = statistic.value
        representations = self._listed(
            f"{prefix}InternalRepresentationsKHR", executable_info, Representation, 1000269005
        )
        texts = [ctypes.create_string_buffer(part.bytes) for part in representations]
        for part, text in zip(representations, texts, strict=True):
            part.data = address(text)
        count = UInt(len(texts))
        self.call(
            f"{prefix}InternalRepresentationsKHR",
            self._device,
            ctypes.byref(executable_info),
            ctypes.byref(count),
            representations,
        )
        for part, text in zip(representations, texts, strict=True):
            if part.isText and b"ssembly" in part.name:
                statistics_of["assembly"] = text.value.decode(errors="replace")
        return statistics_of


def program_statistics(device: NullDevice, program: dict[str, str]) -> dict[str, Any]:
    """Return the driver's statistics of a program of the request, or its error."""
    try:
        pipeline = (
            device.compute(program["comp"]) if "comp" in program else device.graphics(program["vert"], program["frag"])
        )
        return device.statistics(pipeline)
    except VulkanError as error:
        return {"error": str(error)}


def statistics_in_a_process(device: NullDevice, program: dict[str, str]) -> dict[str, Any]:
    """Return the result of `program_statistics` in a separate process, because compilers may crash."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        with os.fdopen(writing, "w") as file:
            json.dump(program_statistics(device, program), file)
        os._exit(0)
    os.close(writing)
    with os.fdopen(reading) as file:
        text = file.read()
    _, status = os.waitpid(child, 0)
    answer: dict[str, Any] = (
        json.loads(text) if status == 0 else {"error": f"the compiler ends with signal {status & 127}"}
    )
    return answer


def main() -> None:
    """Compile the programs that the request names."""
    device = NullDevice(sys.argv[1])
    json.dump([statistics_in_a_process(device, program) for program in json.load(sys.stdin)], sys.stdout)


if __name__ == "__main__":
    main()
