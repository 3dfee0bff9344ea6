// SPDX-License-Identifier: GPL-3.0-or-later
#include "tools/studio/pen.h"

#include <X11/Xlib.h>
#include <X11/extensions/XInput2.h>

#include <algorithm>
#include <vector>

namespace sinew::tools {

// Asked on a connection of its own: no events of the window are touched.
struct Pen::Devices {
  Display* display = nullptr;
  Atom pressure = None;
  std::vector<int> pens;

  // The largest pressure of a device's pens, 0..1; less than 0 where it has none.
  double pressureOf(int device, std::vector<int>* found) const {
    int count = 0;
    XIDeviceInfo* const infos = XIQueryDevice(display, device, &count);
    double most = -1;
    for (int i = 0; i < count; ++i) {
      if (infos[i].use != XISlavePointer && infos[i].use != XIFloatingSlave) continue;
      for (int c = 0; c < infos[i].num_classes; ++c) {
        if (infos[i].classes[c]->type != XIValuatorClass) continue;
        const auto& axis = *reinterpret_cast<const XIValuatorClassInfo*>(infos[i].classes[c]);
        if (axis.label != pressure || !(axis.max > axis.min)) continue;
        most = std::max(most, std::clamp((axis.value - axis.min) / (axis.max - axis.min), 0.0, 1.0));
        if (found != nullptr) found->push_back(infos[i].deviceid);
      }
    }
    if (infos != nullptr) XIFreeDeviceInfo(infos);
    return most;
  }
};

Pen::Pen() : devices_(std::make_unique<Devices>()) {
  devices_->display = XOpenDisplay(nullptr);
  if (devices_->display == nullptr) return;
  int major = 2, minor = 0;
  if (XIQueryVersion(devices_->display, &major, &minor) == Success)
    devices_->pressure = XInternAtom(devices_->display, "Abs Pressure", False);
}

Pen::~Pen() {
  if (devices_->display != nullptr) XCloseDisplay(devices_->display);
}

double Pen::pressure(bool begins) {
  if (devices_->pressure == None) return 1;
  double most = 0;
  if (begins) {
    devices_->pens.clear();
    most = devices_->pressureOf(XIAllDevices, &devices_->pens);
  } else {
    for (const int pen : devices_->pens) most = std::max(most, devices_->pressureOf(pen, nullptr));
  }
  return most > 0 ? most : 1;
}

}  // namespace sinew::tools
