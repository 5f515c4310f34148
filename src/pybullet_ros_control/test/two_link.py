"""A planar arm of two links for tests of generic robots: closed formulas, transmissions of several kinds."""

LENGTH, MASS, INERTIA = 0.5, 2.0, 0.02


def two_link_urdf(
    joint="revolute",
    friction=0.0,
    damping=0.0,
    limit='lower="-2" upper="2" effort="50" velocity="5"',
    transmissions="",
    axis="0 1 0",
    name="planar",
):
    """Links along x, centres of mass in their middle; both joints about `axis`."""
    links, joints = '<link name="base"/>', ""
    for i in (1, 2):
        links += f"""
  <link name="link{i}">
    <inertial><origin xyz="{LENGTH / 2} 0 0"/><mass value="{MASS}"/>
      <inertia ixx="0.001" iyy="{INERTIA}" izz="{INERTIA}" ixy="0" ixz="0" iyz="0"/></inertial>
  </link>"""
        parent, x = ("base", 0.0) if i == 1 else ("link1", LENGTH)
        joints += f"""
  <joint name="joint{i}" type="{joint}">
    <parent link="{parent}"/><child link="link{i}"/><origin xyz="{x} 0 0"/><axis xyz="{axis}"/>
    <limit {limit}/><dynamics damping="{damping}" friction="{friction}"/>
  </joint>"""
    return f'<robot name="{name}">{links}{joints}{transmissions}</robot>'


def transmission(joint, *interfaces, reduction=1.0, offset=None, actuator=None):
    tags = "".join(f"<hardwareInterface>hardware_interface/{name}</hardwareInterface>" for name in interfaces)
    shift = "" if offset is None else f"<offset>{offset}</offset>"
    return f"""
  <transmission name="{joint}_transmission">
    <type>transmission_interface/SimpleTransmission</type>
    <joint name="{joint}">{tags}{shift}</joint>
    <actuator name="{actuator or joint + "_motor"}"><mechanicalReduction>{reduction}</mechanicalReduction></actuator>
  </transmission>"""
