"""Which place is the camera in? A ROS 2 node around the recognizer, for images that are compressed.

python3 ros2_node.py MODEL/ words.npz --ros-args -r image/compressed:=/camera/image_raw/compressed
"""

import sys
from contextlib import suppress

import cv2
import numpy as np
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.utilities import remove_ros_args
from sensor_msgs.msg import CompressedImage
from std_msgs.msg import Float64MultiArray, String

from placerec import DictionarySet, PlacerecError, load_recognizer


class WhichPlace(Node):
    """Publishes the best place, and the belief in each, in the order of the model's places."""

    def __init__(self, model: str, words: str) -> None:
        super().__init__("which_place")
        self.recognizer = load_recognizer(model, dictionary=DictionarySet.load(words))
        self.best = self.create_publisher(String, "place", 1)
        self.belief = self.create_publisher(Float64MultiArray, "belief", 1)
        # The newest image only: those that come while one is worked on are dropped.
        newest = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
        self.create_subscription(CompressedImage, "image/compressed", self.see, newest)
        self.get_logger().info(f"places: {', '.join(self.recognizer.places)}")

    def see(self, message: CompressedImage) -> None:
        """Answer one image."""
        stamp = message.header.stamp
        try:
            image = cv2.imdecode(np.frombuffer(message.data, np.uint8), cv2.IMREAD_GRAYSCALE)
            belief = self.recognizer.update(image, stamp.sec + stamp.nanosec / 1e9)
        except (PlacerecError, cv2.error) as error:
            self.get_logger().warning(f"image left out: {error}")
            return
        self.best.publish(String(data=belief.best))
        self.belief.publish(Float64MultiArray(data=belief.probability.tolist()))


if __name__ == "__main__":
    rclpy.init(args=sys.argv)
    with suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(WhichPlace(*remove_ros_args(sys.argv)[1:]))
