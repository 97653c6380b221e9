// Prints what urdfdom reads in a URDF as JSON: urdf::parseURDF is the function with which MoveIt loads one.
#include <urdf_parser/urdf_parser.h>

#include <fstream>
#include <iostream>
#include <sstream>

using std::cout;

static std::ostream &operator<<(std::ostream &out, const urdf::Vector3 &v) {
  return out << '[' << v.x << ',' << v.y << ',' << v.z << ']';
}

static std::ostream &operator<<(std::ostream &out, const urdf::Pose &pose) {
  const urdf::Rotation &r = pose.rotation;
  return out << "[" << pose.position << ",[" << r.x << ',' << r.y << ',' << r.z << ',' << r.w << "]]";
}

static void print(const urdf::Geometry &shape) {
  if (const auto *box = dynamic_cast<const urdf::Box *>(&shape))
    cout << "[\"box\"," << box->dim << ']';
  else if (const auto *cylinder = dynamic_cast<const urdf::Cylinder *>(&shape))
    cout << "[\"cylinder\",[" << cylinder->radius << ',' << cylinder->length << "]]";
  else if (const auto *sphere = dynamic_cast<const urdf::Sphere *>(&shape))
    cout << "[\"sphere\",[" << sphere->radius << "]]";
  else
    cout << "[\"other\",[]]";
}

template <class Parts> static void print_parts(const char *name, const Parts &parts) {
  const char *comma = "";
  cout << ",\"" << name << "\":[";
  for (const auto &part : parts) {
    cout << comma << "[\"" << part->name << "\",";
    print(*part->geometry);
    cout << ',' << part->origin << ']';
    comma = ",";
  }
  cout << ']';
}

static void print(const urdf::Link &link) {
  const urdf::Inertial &own = *link.inertial;
  cout << "{\"mass\":" << own.mass << ",\"centre\":" << own.origin << ",\"inertia\":[" << own.ixx << ',' << own.iyy
       << ',' << own.izz << ',' << own.ixy << ',' << own.ixz << ',' << own.iyz << ']';
  print_parts("visual", link.visual_array);
  print_parts("collision", link.collision_array);
  cout << '}';
}

static void print(const urdf::Joint &joint) {
  cout << "{\"type\":" << joint.type << ",\"parent\":\"" << joint.parent_link_name << "\",\"child\":\""
       << joint.child_link_name << "\",\"origin\":" << joint.parent_to_joint_origin_transform;
  if (joint.limits)
    cout << ",\"axis\":" << joint.axis << ",\"limits\":[" << joint.limits->lower << ',' << joint.limits->upper << ','
         << joint.limits->effort << ',' << joint.limits->velocity << ']';
  if (joint.mimic)
    cout << ",\"mimic\":[\"" << joint.mimic->joint_name << "\"," << joint.mimic->multiplier << ','
         << joint.mimic->offset << ']';
  cout << '}';
}

template <class Parts> static void print_all(const char *name, const Parts &parts) {
  const char *comma = "";
  cout << ",\"" << name << "\":{";
  for (const auto &[key, part] : parts) {
    cout << comma << '"' << key << "\":";
    print(*part);
    comma = ",";
  }
  cout << '}';
}

int main(int, char **arguments) {
  std::stringstream text;
  text << std::ifstream(arguments[1]).rdbuf();
  const auto model = urdf::parseURDF(text.str());
  if (!model)
    return 1;
  cout.precision(17);
  cout << "{\"name\":\"" << model->getName() << "\",\"root\":\"" << model->getRoot()->name << '"';
  print_all("links", model->links_);
  print_all("joints", model->joints_);
  cout << "}\n";
}
