"""Descriptions of robots in other formats."""

WHEEL = """
  <link name="{name}_wheel_link">
    <inertial><mass value="0.6"/></inertial>
    <collision>
      <origin rpy="1.5707963267948966 0 0"/>
      <geometry><cylinder radius="{radius}" length="0.04"/></geometry>
    </collision>
  </link>
  <joint name="{name}_wheel_joint" type="continuous">
    <parent link="base_link"/><child link="{name}_wheel_link"/>
    <origin xyz="{x} {y} 0" rpy="0 0 {yaw}"/>
    <axis xyz="0 {axis} 0"/>
    <limit effort="3" velocity="30"/>
  </joint>"""

URDF = """<?xml version="1.0"?>
<robot name="my_base">
  <link name="base_footprint"/>
  <joint name="base_joint" type="fixed">
    <parent link="base_footprint"/><child link="base_link"/><origin xyz="0 0 0.05"/>
  </joint>
  <link name="base_link">
    <inertial>
      <origin xyz="0.01 0 0.06"/><mass value="17.6"/>
      <inertia ixx="0.4" ixy="0" ixz="0" iyy="0.5" iyz="0" izz="0.7"/>
    </inertial>
    <collision>
      <origin xyz="0 0 0.06"/><geometry><box size="0.5 0.36 0.12"/></geometry>
    </collision>
    <visual><geometry><mesh filename="package://secret/base.stl"/></geometry></visual>
  </link>{wheels}
</robot>
"""

CORNERS = {
    "front_left": (0.2, 0.18),
    "front_right": (0.2, -0.18),
    "rear_left": (-0.2, 0.18),
    "rear_right": (-0.2, -0.18),
}


def mecanum_urdf(flipped=(), radius=0.05):
    """Four wheels with parallel axles; the axes of flipped wheels point to the right."""
    wheels = "".join(
        WHEEL.format(name=n, x=x, y=y, yaw=0, axis=-1 if n in flipped else 1, radius=radius)
        for n, (x, y) in CORNERS.items()
    )
    return URDF.replace("{wheels}", wheels)


def omni_urdf():
    """Three wheels with radial axles."""
    wheels = "".join(
        WHEEL.format(name=f"omni{k}", x=x, y=y, yaw=yaw, axis=1, radius=0.05)
        for k, (x, y, yaw) in enumerate(
            [(0.2, 0, -1.5707963267948966), (-0.1, 0.1732050808, 0.5235987755982988),
             (-0.1, -0.1732050808, 2.6179938779914944)]
        )
    )  # fmt: skip
    return URDF.replace("{wheels}", wheels)


MECANUM_CONTROLLER = """
controller_manager:
  ros__parameters:
    update_rate: 100
    base_controller:
      type: mecanum_drive_controller/MecanumDriveController
/base_controller:
  ros__parameters:
    reference_timeout: 0.5
    front_left_wheel_command_joint_name: "fl_joint"
    front_right_wheel_command_joint_name: "fr_joint"
    rear_right_wheel_command_joint_name: "rr_joint"
    rear_left_wheel_command_joint_name: "rl_joint"
    kinematics:
      base_frame_offset: { x: 0.0, y: 0.0, theta: 0.0 }
      wheels_radius: 0.05
      sum_of_robot_center_projection_on_X_Y_axis: 0.38
    base_frame_id: base_link
"""

OMNI_CONTROLLER = """
omni_controller:
  ros__parameters:
    wheel_offset: 0.5
    wheel_names: [front, left, right]
    robot_radius: 0.20
    wheel_radius: 0.02
    open_loop: true
"""


MJCF = """<mujoco model="cart">
 <compiler angle="degree"/>
 <default>
  <geom density="500"/>
  <default class="wheel"><geom type="cylinder" size="0.05 0.02"/>
   <joint axis="0 0 1" armature="0.001"/></default>
 </default>
 <worldbody>
  <geom type="plane" size="1 1 1"/>
  <body name="base" pos="0 0 0.05"><freejoint/>
   <geom type="box" size="0.25 0.18 0.05" mass="10" pos="0 0 0.05"/>
   <frame euler="0 0 30">
    <body name="a" pos="0.2 0 0" euler="0 90 0" childclass="wheel">
     <joint name="wheel_a"/><geom/></body>
    <body name="b" pos="-0.1 0.173 0" childclass="wheel"
     quat="0.7071067811865476 0.6123724356957945 0.35355339059327373 0">
     <joint name="wheel_b"/><geom/></body>
    <body name="c" pos="-0.1 -0.173 0" zaxis="-0.5 -0.8660254037844386 0" childclass="wheel">
     <joint name="wheel_c"/><geom/></body>
   </frame>
  </body>
 </worldbody>
 <actuator><velocity joint="wheel_a" kv="2" forcerange="-4 4" ctrlrange="-20 20"/>
 <velocity joint="wheel_b" kv="2" forcerange="-4 4" ctrlrange="-20 20"/>
 <velocity joint="wheel_c" kv="2" forcerange="-4 4" ctrlrange="-20 20"/></actuator>
</mujoco>"""
